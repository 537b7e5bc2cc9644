//! Four frequency lines to a vector register.
//!
//! [`Lanes`] is the arithmetic on four `f64` at once: plain arrays for any processor, AVX2 with fused multiply-add where the
//! processor has it. The choice is made at run time ([`avx2`]), no compiler flag is needed.

/// Lines computed together.
pub(super) const WIDTH: usize = 4;

/// Four numbers in memory, one per line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub(in crate::engine) struct F4(pub [f64; WIDTH]);

/// Four complex numbers in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub(super) struct C4 {
    pub re: F4,
    pub im: F4,
}

impl C4 {
    pub const ZERO: Self = Self { re: F4([0.0; WIDTH]), im: F4([0.0; WIDTH]) };
    pub const ONE: Self = Self { re: F4([1.0; WIDTH]), im: F4([0.0; WIDTH]) };
}

/// Arithmetic on a register of four numbers.
pub(in crate::engine) trait Lanes: Copy {
    fn splat(value: f64) -> Self;
    fn load(from: &F4) -> Self;
    fn store(self, to: &mut F4);
    fn add(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// self + a b
    fn add_mul(self, a: Self, b: Self) -> Self;
    /// self - a b
    fn sub_mul(self, a: Self, b: Self) -> Self;
    fn abs(self) -> Self;
    /// The larger one; `self` where `other` is NaN.
    fn max(self, other: Self) -> Self;
    /// 0 where `size` is below `limit`; NaN is not below anything.
    fn unless_below(self, size: Self, limit: Self) -> Self;
}

macro_rules! each {
    ($f:expr) => {
        Self([$f(0), $f(1), $f(2), $f(3)])
    };
}

impl Lanes for F4 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; WIDTH])
    }
    #[inline(always)]
    fn load(from: &F4) -> Self {
        *from
    }
    #[inline(always)]
    fn store(self, to: &mut F4) {
        *to = self;
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        each!(|i: usize| self.0[i] + other.0[i])
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        each!(|i: usize| self.0[i] * other.0[i])
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        each!(|i: usize| self.0[i] / other.0[i])
    }
    #[inline(always)]
    fn add_mul(self, a: Self, b: Self) -> Self {
        each!(|i: usize| self.0[i] + a.0[i] * b.0[i])
    }
    #[inline(always)]
    fn sub_mul(self, a: Self, b: Self) -> Self {
        each!(|i: usize| self.0[i] - a.0[i] * b.0[i])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        each!(|i: usize| self.0[i].abs())
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        each!(|i: usize| if other.0[i] > self.0[i] { other.0[i] } else { self.0[i] })
    }
    #[inline(always)]
    fn unless_below(self, size: Self, limit: Self) -> Self {
        each!(|i: usize| if size.0[i] < limit.0[i] { 0.0 } else { self.0[i] })
    }
}

/// Whether this processor has AVX2 and fused multiply-add.
#[cfg(target_arch = "x86_64")]
pub(in crate::engine) fn avx2() -> bool {
    std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
}

/// A function whose body is compiled twice, and runs in the widest registers that the processor has: what it calls has to be inlined (`#[inline(always)]`).
/// `Register` is the type of these registers in it, [`Avx2`] or plain [`F4`].
macro_rules! widest {
    (fn $name:ident $([$($generic:tt)+])? ($($argument:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        fn $name $(<$($generic)+>)? ($($argument: $type),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,fma")]
                fn wide $(<$($generic)+>)? ($($argument: $type),*) $(-> $out)? {
                    #[allow(dead_code)]
                    type Register = $crate::engine::blocktri::Avx2;
                    $body
                }
                if $crate::engine::blocktri::avx2() {
                    // SAFETY: the processor has what the function is compiled for.
                    return unsafe { wide($($argument),*) };
                }
            }
            #[allow(dead_code)]
            type Register = $crate::engine::blocktri::F4;
            $body
        }
    };
}
pub(in crate::engine) use widest;

#[cfg(target_arch = "x86_64")]
pub(in crate::engine) use x86::Avx2;

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{F4, Lanes};
    use std::arch::x86_64::*;

    /// Four numbers in an AVX register. Only made inside functions compiled for `avx2,fma`, which are entered after [`super::avx2`].
    #[derive(Clone, Copy)]
    pub struct Avx2(__m256d);

    // SAFETY of every block below: the type exists only where the processor has AVX2 and FMA, see above; F4 is 32-byte aligned.
    impl Lanes for Avx2 {
        #[inline(always)]
        fn splat(value: f64) -> Self {
            unsafe { Self(_mm256_set1_pd(value)) }
        }
        #[inline(always)]
        fn load(from: &F4) -> Self {
            unsafe { Self(_mm256_load_pd(from.0.as_ptr())) }
        }
        #[inline(always)]
        fn store(self, to: &mut F4) {
            unsafe { _mm256_store_pd(to.0.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn add(self, other: Self) -> Self {
            unsafe { Self(_mm256_add_pd(self.0, other.0)) }
        }
        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            unsafe { Self(_mm256_mul_pd(self.0, other.0)) }
        }
        #[inline(always)]
        fn div(self, other: Self) -> Self {
            unsafe { Self(_mm256_div_pd(self.0, other.0)) }
        }
        #[inline(always)]
        fn add_mul(self, a: Self, b: Self) -> Self {
            unsafe { Self(_mm256_fmadd_pd(a.0, b.0, self.0)) }
        }
        #[inline(always)]
        fn sub_mul(self, a: Self, b: Self) -> Self {
            unsafe { Self(_mm256_fnmadd_pd(a.0, b.0, self.0)) }
        }
        #[inline(always)]
        fn abs(self) -> Self {
            unsafe { Self(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0)) }
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // The instruction returns its second operand where one is NaN.
            unsafe { Self(_mm256_max_pd(other.0, self.0)) }
        }
        #[inline(always)]
        fn unless_below(self, size: Self, limit: Self) -> Self {
            unsafe { Self(_mm256_and_pd(self.0, _mm256_cmp_pd::<_CMP_NLT_UQ>(size.0, limit.0))) }
        }
    }
}

/// Complex arithmetic on registers.
#[derive(Clone, Copy)]
pub(super) struct Cv<V> {
    pub re: V,
    pub im: V,
}

impl<V: Lanes> Cv<V> {
    #[inline(always)]
    pub fn zero() -> Self {
        Self { re: V::splat(0.0), im: V::splat(0.0) }
    }
    #[inline(always)]
    pub fn load(from: &C4) -> Self {
        Self { re: V::load(&from.re), im: V::load(&from.im) }
    }
    #[inline(always)]
    pub fn store(self, to: &mut C4) {
        self.re.store(&mut to.re);
        self.im.store(&mut to.im);
    }
    /// self - a b
    #[inline(always)]
    pub fn sub_mul(self, a: Self, b: Self) -> Self {
        Self { re: self.re.sub_mul(a.re, b.re).add_mul(a.im, b.im), im: self.im.sub_mul(a.re, b.im).sub_mul(a.im, b.re) }
    }
    /// self + a b
    #[inline(always)]
    pub fn add_mul(self, a: Self, b: Self) -> Self {
        Self { re: self.re.add_mul(a.re, b.re).sub_mul(a.im, b.im), im: self.im.add_mul(a.re, b.im).add_mul(a.im, b.re) }
    }
    /// self + s a with s real
    #[inline(always)]
    pub fn add_scaled(self, s: V, a: Self) -> Self {
        Self { re: self.re.add_mul(s, a.re), im: self.im.add_mul(s, a.im) }
    }
    #[inline(always)]
    pub fn mul(self, b: Self) -> Self {
        Self { re: self.re.mul(b.re).sub_mul(self.im, b.im), im: self.re.mul(b.im).add_mul(self.im, b.re) }
    }
    /// 1/self; not finite where self is 0 or overflows when squared.
    #[inline(always)]
    pub fn reciprocal(self) -> Self {
        let scale = V::splat(1.0).div(self.square());
        Self { re: self.re.mul(scale), im: V::splat(0.0).sub_mul(self.im, scale) }
    }
    /// |self|^2
    #[inline(always)]
    pub fn square(self) -> V {
        self.re.mul(self.re).add_mul(self.im, self.im)
    }
    /// |re| + |im|
    #[inline(always)]
    pub fn magnitude(self) -> V {
        self.re.abs().add(self.im.abs())
    }
}
