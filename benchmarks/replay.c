/* The control loop of eaid.replay in C: the limit that the Python is held against.
 *
 * One plant, the libm's expm1 and tanh, in REAL (double; long double is the reference of the accuracy rows).
 */
#include <math.h>
#ifndef REAL
#define REAL double
#define EXPM1 expm1
#define TANH tanh
#define SQRT sqrt
#define FABS fabs
#define COPYSIGN copysign
#else
#define EXPM1 expm1l
#define TANH tanhl
#define SQRT sqrtl
#define FABS fabsl
#define COPYSIGN copysignl
#endif
#define LIMIT 19.1

enum { C, A0, A1, A2, B0, B1, B2, S0, S1, S2, S3, LOW, HIGH, R1, R2, PLANT };
enum { KP, KD, BHAT, MA0, MB0, MC0, RHO0, RHO1, EPS, GAMMA, Q12, Q22, UMIN, UMAX, GAINS };

static inline REAL soft_switch(const REAL *g, REAL z, REAL rho, REAL distance)
{
    REAL linear = rho * z / g[EPS];
    if (distance > LIMIT) return COPYSIGN(rho, z);
    if (distance < -LIMIT) return linear;
    REAL at_zero = TANH(g[GAMMA] * g[EPS]);
    REAL share = (TANH(distance) + at_zero) / (1 + at_zero);
    return share * COPYSIGN(rho, z) + (1 - share) * linear;
}

void replay_one(long n, const double *gains, const double *plant, double dt_, const double *reference, const double *rate,
                const double *noise, double *torque, double *duty)
{
    REAL g[GAINS], p[PLANT], dt = dt_, x1 = 0, x2 = 0, q = 0;
    for (int i = 0; i < GAINS; i++) g[i] = gains[i];
    for (int i = 0; i < PLANT; i++) p[i] = plant[i];
    for (long k = 0; k < n; k++) {
        REAL seen = x1 + x2 + noise[k], e = reference[k] - seen;
        torque[k] = x1 + x2;
        REAL z = g[Q12] * q + g[Q22] * e, rho = g[RHO0] + g[RHO1] * SQRT(q * q + e * e);
        REAL omega = soft_switch(g, z, rho, g[GAMMA] * (FABS(z) - g[EPS]));
        REAL wanted = g[BHAT] * (rate[k] + g[KD] * e + g[KP] * q + omega) + (g[MA0] * seen - g[MC0]) / g[MB0];
        REAL u = wanted < g[UMIN] ? g[UMIN] : wanted > g[UMAX] ? g[UMAX] : wanted;
        if (!((wanted - u) * e > 0)) q += dt * e;
        duty[k] = u;
        REAL share = 1;
        if (u < p[LOW]) { share = u > 0 ? u / p[LOW] : 0; u = p[LOW]; }
        else if (u > p[HIGH]) u = p[HIGH];
        REAL t1 = p[A0] + u * (p[A1] + u * p[A2]), t2 = p[B0] + u * (p[B1] + u * p[B2]);
        REAL s = share * (p[S0] + u * (p[S1] + u * (p[S2] + u * p[S3])));
        if (t1 < (REAL)1e-3) t1 = (REAL)1e-3;
        if (t2 < t1) t2 = t1;
        if (s < 0) s = 0;
        REAL fast = p[C] * s - x1, slow = s - p[C] * s - x2;
        if (fast < 0 && p[R1] > 0) t1 = p[R1];
        if (slow < 0 && p[R2] > 0) t2 = p[R2];
        x1 -= EXPM1(-dt / t1) * fast;
        x2 -= EXPM1(-dt / t2) * slow;
    }
}

