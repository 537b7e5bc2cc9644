//! Six parameters of the chain from its noisy FRF: residuals and exact Jacobian.
