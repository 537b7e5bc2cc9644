"""Own integrator: RK4 on chains of masses joined by elements with internal states; massless elements driven along a prescribed path."""
import numpy as np
from numba import njit

@njit(cache=True)
def elem(t, P, q, v, z, dz):
    """force of one element; fills dz"""
    if t == 0:                                   # spring, damper, optional play P[2] (total gap) in series
        g = 0.5*P[2]
        if g > 0:
            if q > g:
                f = P[0]*(q-g)+P[1]*v
                return f if f > 0 else 0.0
            if q < -g:
                f = P[0]*(q+g)+P[1]*v
                return f if f < 0 else 0.0
            return 0.0
        return P[0]*q+P[1]*v
    if t == 1:                                   # Jenkins
        zs = P[1]/P[0]
        zz = min(max(z[0], -zs), zs)
        dz[0] = 0.0 if ((zz >= zs and v > 0) or (zz <= -zs and v < 0)) else v
        return P[0]*zz
    if t == 2:                                   # parallel sliders
        n = int(P[2]); f = 0.0; kt = P[0]/n
        for i in range(n):
            zs = 2*P[1]*(i+0.5)/(n*n)/kt
            zz = min(max(z[i], -zs), zs)
            dz[i] = 0.0 if ((zz >= zs and v > 0) or (zz <= -zs and v < 0)) else v
            f += kt*zz
        return f
    if t == 3:                                   # Bouc-Wen: Fmax, z0, n, beta, gamma
        s = 1.0 if v*z[0] > 0 else (-1.0 if v*z[0] < 0 else 0.0)
        dz[0] = v/P[1]*(1-abs(z[0])**P[2]*(P[3]*s+P[4]))
        return P[0]*z[0]
    if t == 4:                                   # LuGre: s0, s1, Fc, Fs, vs
        g = P[2]+(P[3]-P[2])*np.exp(-(v/P[4])**2)
        d = v-P[0]*abs(v)/g*z[0]
        dz[0] = d
        return P[0]*z[0]+P[1]*d
    if t == 5:
        return P[0]*q*q*q
    if t == 6:
        if q > P[1]: return P[0]*(q-P[1])
        if q < -P[1]: return P[0]*(q+P[1])
        return 0.0
    if t == 7:                                   # one-sided: k, gap, exponent, side
        u = P[3]*q-P[1]
        return P[3]*P[0]*u**P[2] if u > 0 else 0.0
    if t == 8:
        return P[0]*v*abs(v)
    if t == 9:
        dz[0] = v-P[0]/P[1]*z[0]
        return P[0]*z[0]
    if t == 10:
        return P[0]
    if t == 11:                                  # friction in proportion to |q|; direction turns over within P[1]
        zz = min(max(z[0], -P[1]), P[1])
        dz[0] = 0.0 if ((zz >= P[1] and v > 0) or (zz <= -P[1] and v < 0)) else v
        return P[0]*abs(q)*zz/P[1]
    if t == 12:
        return P[0]*P[1]*np.tanh(q/P[1])
    if t == 13:
        return P[0]*q*q
    if t == 14:
        return P[0]*v if v*P[1] > 0 else 0.0
    if t == 15:
        return P[0]*np.tanh(v/P[1])
    return 0.0

@njit(cache=True)
def clip(T, P, off, z):
    for e in range(T.size):
        if T[e] == 1:
            zs = P[e,1]/P[e,0]; i = off[e]; z[i] = min(max(z[i], -zs), zs)
        elif T[e] == 11:
            zs = P[e,1]; i = off[e]; z[i] = min(max(z[i], -zs), zs)
        elif T[e] == 2:
            n = int(P[e,2]); kt = P[e,0]/n
            for i in range(n):
                zs = 2*P[e,1]*(i+0.5)/(n*n)/kt
                z[off[e]+i] = min(max(z[off[e]+i], -zs), zs)

@njit(cache=True)
def rhs(T, A, B, P, off, m, q, v, z, f, drive, a, dz):
    n = m.size
    for i in range(n): a[i] = 0.0
    a[drive] = f
    for e in range(T.size):
        qa = 0.0; va = 0.0
        if A[e] >= 0: qa = q[A[e]]; va = v[A[e]]
        F = elem(T[e], P[e], q[B[e]]-qa, v[B[e]]-va, z[off[e]:], dz[off[e]:])
        a[B[e]] -= F
        if A[e] >= 0: a[A[e]] += F
    for i in range(n): a[i] /= m[i]

@njit(cache=True)
def step(T, A, B, P, off, m, q, v, z, f0, f1, f2, drive, h, W):
    n = m.size; s = z.size
    a1 = W[0,:n]; a2 = W[1,:n]; a3 = W[2,:n]; a4 = W[3,:n]
    d1 = W[4,:s]; d2 = W[5,:s]; d3 = W[6,:s]; d4 = W[7,:s]
    qq = W[8,:n]; vv = W[9,:n]; zz = W[10,:s]; v2 = W[11,:n]; v3 = W[12,:n]; v4 = W[13,:n]
    d1[:] = 0; d2[:] = 0; d3[:] = 0; d4[:] = 0
    rhs(T, A, B, P, off, m, q, v, z, f0, drive, a1, d1)
    for i in range(n): qq[i] = q[i]+.5*h*v[i]; v2[i] = v[i]+.5*h*a1[i]
    for i in range(s): zz[i] = z[i]+.5*h*d1[i]
    rhs(T, A, B, P, off, m, qq, v2, zz, f1, drive, a2, d2)
    for i in range(n): qq[i] = q[i]+.5*h*v2[i]; v3[i] = v[i]+.5*h*a2[i]
    for i in range(s): zz[i] = z[i]+.5*h*d2[i]
    rhs(T, A, B, P, off, m, qq, v3, zz, f1, drive, a3, d3)
    for i in range(n): qq[i] = q[i]+h*v3[i]; v4[i] = v[i]+h*a3[i]
    for i in range(s): zz[i] = z[i]+h*d3[i]
    rhs(T, A, B, P, off, m, qq, v4, zz, f2, drive, a4, d4)
    for i in range(n):
        q[i] += h/6*(v[i]+2*v2[i]+2*v3[i]+v4[i]); v[i] += h/6*(a1[i]+2*a2[i]+2*a3[i]+a4[i])
    for i in range(s): z[i] += h/6*(d1[i]+2*d2[i]+2*d3[i]+d4[i])
    clip(T, P, off, z)

@njit(cache=True)
def sine(T, A, B, P, off, m, drive, F, w, ph, nsamp, nsub, h, q, v, z, Q):
    """steps under F sin(w t + ph); stores q before every nsub-th step; returns complex Fourier sums over everything (2/N sum q e^{-i})"""
    W = np.zeros((14, max(m.size, z.size)+1)); t = 0.0; k = 0
    C = np.zeros(m.size, np.complex128)
    for j in range(nsamp):
        for i in range(m.size):
            if Q.shape[0] > 0: Q[j, i] = q[i]
        for l in range(nsub):
            t = k*h
            e = np.exp(-1j*(w*t+ph))
            for i in range(m.size): C[i] += q[i]*e
            step(T, A, B, P, off, m, q, v, z, F*np.sin(w*t+ph), F*np.sin(w*(t+.5*h)+ph), F*np.sin(w*(t+h)+ph), drive, h, W)
            k += 1
    return C*2/(nsamp*nsub)

@njit(cache=True)
def record(T, A, B, P, off, m, drive, f, nsamp, nsub, h, Q, V, AA):
    """f at half steps"""
    n = m.size; q = np.zeros(n); v = np.zeros(n); z = np.zeros(off[-1])
    W = np.zeros((14, max(n, z.size)+1)); dz = np.zeros(max(z.size, 1)); a = np.zeros(n); k = 0
    for j in range(nsamp):
        rhs(T, A, B, P, off, m, q, v, z, f[2*k], drive, a, dz)
        for i in range(n): Q[j, i] = q[i]; V[j, i] = v[i]; AA[j, i] = a[i]
        for l in range(nsub):
            step(T, A, B, P, off, m, q, v, z, f[2*k], f[2*k+1], f[2*k+2], drive, h, W); k += 1

@njit(cache=True)
def path(T, P, off, x, v, nsamp, nsub, h, F):
    """massless elements side by side along x, v given at half steps"""
    s = off[-1]; z = np.zeros(s); d = np.zeros((4, s+1)); zz = np.zeros(s); k = 0
    for j in range(nsamp):
        f = 0.0
        for e in range(T.size): f += elem(T[e], P[e], x[2*k], v[2*k], z[off[e]:], d[0, off[e]:])
        F[j] = f
        for l in range(nsub):
            d[:] = 0
            for e in range(T.size): elem(T[e], P[e], x[2*k], v[2*k], z[off[e]:], d[0, off[e]:])
            for i in range(s): zz[i] = z[i]+.5*h*d[0, i]
            for e in range(T.size): elem(T[e], P[e], x[2*k+1], v[2*k+1], zz[off[e]:], d[1, off[e]:])
            for i in range(s): zz[i] = z[i]+.5*h*d[1, i]
            for e in range(T.size): elem(T[e], P[e], x[2*k+1], v[2*k+1], zz[off[e]:], d[2, off[e]:])
            for i in range(s): zz[i] = z[i]+h*d[2, i]
            for e in range(T.size): elem(T[e], P[e], x[2*k+2], v[2*k+2], zz[off[e]:], d[3, off[e]:])
            for i in range(s): z[i] += h/6*(d[0, i]+2*d[1, i]+2*d[2, i]+d[3, i])
            clip(T, P, off, z); k += 1
