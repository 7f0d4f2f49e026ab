/* The control loop of eaid.replay in C: the limit that the Python is held against.
 *
 * replay_one:  one plant, the libm's expm1 and tanh, in REAL (double; long double is the reference of the accuracy row).
 * replay_many: blocks of sixteen plants, time outermost, #pragma omp simd inside and OpenMP threads outside, with the
 *              polynomial and the rare tanh of eaid/replay/lanes.py.
 */
#include <math.h>
#include <stdlib.h>
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
#define LANES 16
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

#ifdef _OPENMP
/* plants: PLANT rows of `lanes` plants each (a multiple of 16); per: coefficients of (1 - e^-x)/x, 14 of them;
 * torque, duty: one (n, 16) buffer a thread, overwritten block by block, as in eaid/replay/many.py. */
void replay_many(long n, long lanes, const double *g, const double *plants, double dt, const double *reference,
                 const double *rate, const double *noise, const double *per, double *torque_all, double *duty_all,
                 int threads)
{
    double c0 = per[0], c1 = per[1], c2 = per[2], c3 = per[3], c4 = per[4], c5 = per[5], c6 = per[6], c7 = per[7],
           c8 = per[8], c9 = per[9], c10 = per[10], c11 = per[11], c12 = per[12], c13 = per[13];
#define LOSS(x)                                                                                                        \
    ((x) * (c0 + (x) * (c1 + (x) * (c2 + (x) * (c3 + (x) * (c4 + (x) * (c5 + (x) * (c6 + (x) * (c7 + (x) * (c8 +       \
    (x) * (c9 + (x) * (c10 + (x) * (c11 + (x) * (c12 + (x) * c13))))))))))))))
#pragma omp parallel for schedule(static) num_threads(threads)
    for (long block = 0; block < lanes / LANES; block++) {
        extern int omp_get_thread_num(void);
        double *restrict torque = torque_all + (size_t)omp_get_thread_num() * n * LANES;
        double *restrict duty = duty_all + (size_t)omp_get_thread_num() * n * LANES;
        double p[PLANT][LANES] __attribute__((aligned(64))), x1[LANES] __attribute__((aligned(64))) = {0};
        double x2[LANES] __attribute__((aligned(64))) = {0}, q[LANES] __attribute__((aligned(64))) = {0};
        double om[LANES] __attribute__((aligned(64))), e[LANES] __attribute__((aligned(64)));
        double di[LANES] __attribute__((aligned(64))), beyond[LANES] __attribute__((aligned(64)));
        for (int row = 0; row < PLANT; row++)
            for (int i = 0; i < LANES; i++) p[row][i] = plants[row * lanes + block * LANES + i];
        for (long k = 0; k < n; k++) {
            double r = reference[k], v = rate[k], d = noise[k];
            int rare = 0;
#pragma omp simd reduction(| : rare)
            for (int i = 0; i < LANES; i++) {
                double ei = r - (x1[i] + x2[i] + d), z = g[Q12] * q[i] + g[Q22] * ei;
                double rho = g[RHO0] + g[RHO1] * sqrt(q[i] * q[i] + ei * ei);
                double distance = g[GAMMA] * (fabs(z) - g[EPS]);
                om[i] = distance > LIMIT ? copysign(rho, z) : rho * z / g[EPS];
                e[i] = ei;
                di[i] = distance;
                rare |= (distance <= LIMIT) & (distance >= -LIMIT);
            }
            if (rare)
                for (int i = 0; i < LANES; i++)
                    if (di[i] <= LIMIT && di[i] >= -LIMIT) {
                        double z = g[Q12] * q[i] + g[Q22] * e[i];
                        om[i] = soft_switch(g, z, g[RHO0] + g[RHO1] * sqrt(q[i] * q[i] + e[i] * e[i]), di[i]);
                    }
#pragma omp simd
            for (int i = 0; i < LANES; i++) {
                double low = p[LOW][i], high = p[HIGH][i], r1 = p[R1][i], r2 = p[R2][i];
                double T = x1[i] + x2[i], ei = e[i];
                double umin = g[UMIN], umax = g[UMAX];
                double wanted = g[BHAT] * (v + g[KD] * ei + g[KP] * q[i] + om[i]) + (g[MA0] * (T + d) - g[MC0]) / g[MB0];
                double u = fmin(fmax(wanted, umin), umax);
                beyond[i] = (wanted - u) * ei;
                torque[k * LANES + i] = T;
                duty[k * LANES + i] = u;
                double share = fmin(fmax(u, 0) / low, 1); /* no branch: it would stop the vectors */
                u = fmin(fmax(u, low), high);
                double t1 = p[A0][i] + u * (p[A1][i] + u * p[A2][i]), t2 = p[B0][i] + u * (p[B1][i] + u * p[B2][i]);
                double s = share * (p[S0][i] + u * (p[S1][i] + u * (p[S2][i] + u * p[S3][i])));
                t1 = fmax(t1, 1e-3);
                t2 = fmax(t2, t1);
                s = fmax(s, 0);
                double fast = p[C][i] * s - x1[i], slow = s - p[C][i] * s - x2[i];
                t1 = (fast < 0) & (r1 > 0) ? r1 : t1;
                t2 = (slow < 0) & (r2 > 0) ? r2 : t2;
                double a = dt / t1, b = dt / t2;
                x1[i] += LOSS(a) * fast;
                x2[i] += LOSS(b) * slow;
            }
#pragma omp simd
            for (int i = 0; i < LANES; i++) q[i] += (beyond[i] > 0 ? 0 : dt) * e[i];
        }
    }
}
#endif
