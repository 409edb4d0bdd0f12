/* The interacting multiple model in C: what the compiled bank of filters is measured against.
 *
 * As a C programmer would write it for one bank: sizes and gains are known to the compiler.
 * Probabilities of modes are kept as they stand, with likelihoods relative to the greatest;
 * covariances are in Joseph's form, computed as triangles. All members are doubles, so that the
 * caller can fill a structure from one row of numbers.
 */

#include <math.h>

enum { STATES = 4, INPUTS = 1, OUTPUTS = 1, MODES = 3 };

#define EACH(i, size) for (int i = 0; i < size; i++)

typedef double square[STATES][STATES];
typedef double tall[STATES][OUTPUTS];

typedef struct {
    square A;
    double B[STATES][INPUTS], C[OUTPUTS][STATES], D[OUTPUTS][INPUTS];
    square Q;
    double R[OUTPUTS][OUTPUTS];
    tall inverse; /* pseudo-inverse of C */
    double layer[OUTPUTS], rate;
} mode;

typedef struct {
    mode modes[MODES];
    double transition[MODES][MODES];
} bank;

typedef struct {
    double mean[MODES][STATES];
    square covariance[MODES];
    double error[MODES][OUTPUTS], probability[MODES];
} posteriors;

typedef enum { KALMAN, SWITCHING } gain;

/* Mean and covariance of a mixture. */
static inline void mixture(const double weight[MODES], const posteriors *b, double mean[STATES],
                           square covariance) {
    EACH(a, STATES) {
        mean[a] = 0.0;
        EACH(i, MODES) mean[a] += weight[i] * b->mean[i][a];
    }
    double apart[MODES][STATES];
    EACH(i, MODES) EACH(a, STATES) apart[i][a] = b->mean[i][a] - mean[a];
    EACH(a, STATES) EACH(c, a + 1) {
        double s = 0.0;
        EACH(i, MODES) s += weight[i] * (b->covariance[i][a][c] + apart[i][a] * apart[i][c]);
        covariance[a][c] = covariance[c][a] = s;
    }
}

static inline void output_error(const mode *m, const double *z, const double *u,
                                const double x[STATES], double error[OUTPUTS]) {
    EACH(o, OUTPUTS) {
        error[o] = z[o];
        EACH(p, INPUTS) error[o] -= m->D[o][p] * u[p];
        EACH(a, STATES) error[o] -= m->C[o][a] * x[a];
    }
}

/* One filter takes a sample; returns the squared distance of the measurement, and by `root` the
 * root of the determinant of its covariance: likelihoods differ by nothing else. The
 * inputs `u` are that over the step, then that of the row. */
static inline double filter(gain kind, const mode *m, const double *z, const double *u,
                            double x[STATES], square P, double error[OUTPUTS],
                            double innovation[OUTPUTS], double *root) {
    double moved[STATES];
    square T, spread;
    EACH(a, STATES) {
        moved[a] = 0.0;
        EACH(p, INPUTS) moved[a] += m->B[a][p] * u[p];
        EACH(b, STATES) moved[a] += m->A[a][b] * x[b];
    }
    EACH(a, STATES) EACH(b, STATES) {
        T[a][b] = 0.0;
        EACH(i, STATES) T[a][b] += m->A[a][i] * P[i][b];
    }
    EACH(a, STATES) EACH(b, a + 1) {
        double s = m->Q[a][b];
        EACH(i, STATES) s += T[a][i] * m->A[b][i];
        spread[a][b] = spread[b][a] = s;
    }
    output_error(m, z, u + INPUTS, moved, innovation);

    tall cross, K, rest;
    double L[OUTPUTS][OUTPUTS], distance = 0.0, scaled[OUTPUTS];
    *root = 1.0;
    EACH(a, STATES) EACH(o, OUTPUTS) {
        cross[a][o] = 0.0;
        EACH(b, STATES) cross[a][o] += spread[a][b] * m->C[o][b];
    }
    EACH(o, OUTPUTS) {
        EACH(q, o + 1) {
            double s = m->R[o][q];
            EACH(a, STATES) s += m->C[o][a] * cross[a][q];
            EACH(i, q) s -= L[o][i] * L[q][i];
            L[o][q] = o == q ? sqrt(s) : s / L[q][q];
        }
        scaled[o] = innovation[o];
        EACH(i, o) scaled[o] -= L[o][i] * scaled[i];
        scaled[o] /= L[o][o];
        distance += scaled[o] * scaled[o];
        *root *= L[o][o];
    }
    if (kind == KALMAN) {
        EACH(a, STATES) {
            EACH(o, OUTPUTS) {
                K[a][o] = cross[a][o];
                EACH(i, o) K[a][o] -= L[o][i] * K[a][i];
                K[a][o] /= L[o][o];
            }
            for (int o = OUTPUTS - 1; o >= 0; o--) {
                for (int i = o + 1; i < OUTPUTS; i++) K[a][o] -= L[i][o] * K[a][i];
                K[a][o] /= L[o][o];
            }
        }
    } else {
        EACH(o, OUTPUTS) {
            const double size = fabs(innovation[o]);
            const double share =
                (size + m->rate * fabs(error[o])) / (size > m->layer[o] ? size : m->layer[o]);
            EACH(a, STATES) K[a][o] = m->inverse[a][o] * share;
        }
    }

    EACH(a, STATES) {
        x[a] = moved[a];
        EACH(o, OUTPUTS) x[a] += K[a][o] * innovation[o];
    }
    /* With M = I - K C, first T = M P, then T M' + K R K' = T - (T C' - K R) K'. */
    EACH(a, STATES) EACH(b, STATES) {
        T[a][b] = spread[a][b];
        EACH(o, OUTPUTS) T[a][b] -= K[a][o] * cross[b][o];
    }
    EACH(a, STATES) EACH(o, OUTPUTS) {
        rest[a][o] = 0.0;
        EACH(b, STATES) rest[a][o] += T[a][b] * m->C[o][b];
        EACH(q, OUTPUTS) rest[a][o] -= K[a][q] * m->R[q][o];
    }
    EACH(a, STATES) EACH(b, a + 1) {
        double s = T[a][b];
        EACH(o, OUTPUTS) s -= rest[a][o] * K[b][o];
        P[a][b] = P[b][a] = s;
    }
    if (kind == SWITCHING) output_error(m, z, u + INPUTS, x, error);
    return distance;
}

static inline long run(gain kind, const bank *restrict k, posteriors *restrict b,
                       const double *restrict z, const double *restrict u, long rows,
                       double *restrict estimates, double *restrict covariances,
                       double *restrict probabilities, double *restrict innovations) {
    for (long row = 0; row < rows; row++) {
        posteriors mixed = *b;
        double logarithm[MODES], greatest = -INFINITY, total = 0.0;
        EACH(j, MODES) {
            double weight[MODES], ahead = 0.0;
            EACH(i, MODES) {
                weight[i] = k->transition[i][j] * b->probability[i];
                ahead += weight[i];
            }
            EACH(i, MODES) weight[i] /= ahead;
            mixture(weight, b, mixed.mean[j], mixed.covariance[j]);
            logarithm[j] = ahead;
        }
        EACH(j, MODES) {
            double root;
            const double distance =
                filter(kind, &k->modes[j], z + OUTPUTS * row, u + INPUTS * row, mixed.mean[j],
                       mixed.covariance[j], mixed.error[j],
                       innovations + OUTPUTS * (MODES * row + j), &root);
            logarithm[j] = log(logarithm[j] / root) - 0.5 * distance;
            if (logarithm[j] > greatest) greatest = logarithm[j];
        }
        EACH(j, MODES) {
            mixed.probability[j] = exp(logarithm[j] - greatest);
            total += mixed.probability[j];
        }
        EACH(j, MODES) probabilities[MODES * row + j] = mixed.probability[j] /= total;
        *b = mixed;
        double *mean = estimates + STATES * row, whole = total;
        double(*covariance)[STATES] = (double(*)[STATES])(covariances + STATES * STATES * row);
        mixture(b->probability, b, mean, covariance);
        EACH(a, STATES) whole += mean[a] + covariance[a][a];
        if (!isfinite(whole)) return row;
    }
    return rows;
}

#define LOOP(name, kind)                                                                       \
    long name(const bank *k, posteriors *b, const double *z, const double *u, long rows,       \
              double *estimates, double *covariances, double *probabilities,                   \
              double *innovations) {                                                           \
        return run(kind, k, b, z, u, rows, estimates, covariances, probabilities, innovations);\
    }

LOOP(kalman, KALMAN)
LOOP(switching, SWITCHING)
