/* Kalman filters in C, linear, extended and unscented, and their smoother: what the compiled ones
 * are measured against.
 *
 * As a C programmer would write them for one model: the compiler knows the numbers of states N,
 * outputs M and inputs P, given by -D, and the nonlinear functions. Covariances are in Joseph's
 * form, computed as triangles. All members are doubles, so that the caller can fill a structure
 * from one row of numbers.
 */

#include <math.h>
#include <string.h>

#define EACH(i, size) for (int i = 0; i < size; i++)

static const double T = 0.05, HALF_LOG_TWO_PI = 0.91893853320467274178;

typedef double square[N][N];
typedef double wide[M][N];
typedef double tall[N][M];
typedef double points[2 * N + 1][N];
typedef double images[2 * N + 1][M];

typedef struct {
    square A;
    double B[N][P];
    wide C;
    double D[M][P];
    square Q;
    double R[M][M];
} model;

/* Of sigma points: how far they are spread, the weight of all but the first, and that of the first
 * one in covariances. */
typedef struct {
    double spread, each, first;
} weights;

typedef enum { LINEAR, EXTENDED, UNSCENTED } kind;

/* A damped ring, driven in its last states and measured in its first ones. */
static inline void f(const double x[N], const double u[P], double out[N]) {
    EACH(i, N) out[i] = x[i] + T * (sin(x[(i + 1) % N]) - x[i]);
    EACH(p, P) out[N - 1 - p] += T * u[p];
}

static inline void F(const double x[N], square out) {
    memset(out, 0, sizeof(square));
    EACH(i, N) {
        out[i][i] = 1.0 - T;
        out[i][(i + 1) % N] += T * cos(x[(i + 1) % N]);
    }
}

static inline void h(const double x[N], double out[M]) { EACH(o, M) out[o] = x[o]; }

static inline void H(wide out) {
    memset(out, 0, sizeof(wide));
    EACH(o, M) out[o][o] = 1.0;
}

/* The prediction: its mean, P A' and A P A' + Q. */
static inline void predict(kind which, const model *m, const double u[P], const double x[N],
                           square cov, double moved[N], square cross, square ahead) {
    square jacobian;
    const double(*A)[N] = m->A;
    if (which == LINEAR) {
        EACH(a, N) {
            moved[a] = 0.0;
            EACH(p, P) moved[a] += m->B[a][p] * u[p];
            EACH(b, N) moved[a] += A[a][b] * x[b];
        }
    } else {
        f(x, u, moved);
        F(x, jacobian);
        A = (const double(*)[N])jacobian;
    }
    EACH(a, N) EACH(b, N) {
        cross[a][b] = 0.0;
        EACH(i, N) cross[a][b] += cov[a][i] * A[b][i];
    }
    EACH(a, N) EACH(b, a + 1) {
        double s = m->Q[a][b];
        EACH(i, N) s += A[a][i] * cross[i][b];
        ahead[a][b] = ahead[b][a] = s;
    }
}

static inline void root_of(square cov, square L) {
    EACH(a, N) EACH(b, a + 1) {
        double s = cov[a][b];
        EACH(i, b) s -= L[a][i] * L[b][i];
        L[a][b] = a == b ? sqrt(s) : s / L[b][b];
        L[b][a] = a == b ? L[a][a] : 0.0;
    }
}

static inline void place(const weights *w, const double x[N], square L, points X) {
    EACH(a, N) X[0][a] = x[a];
    EACH(i, N) EACH(a, N) {
        X[1 + i][a] = x[a] + w->spread * L[a][i];
        X[1 + N + i][a] = x[a] - w->spread * L[a][i];
    }
}

/* Of `size` numbers in each row of Y: the mean, which is subtracted, and the covariance. */
#define SPREAD(size, Y, mean, noise, cov)                                                      \
    EACH(a, size) {                                                                            \
        double s = 0.0;                                                                        \
        for (int i = 1; i < 2 * N + 1; i++) s += Y[i][a] - Y[0][a];                            \
        mean[a] = Y[0][a] + w->each * s;                                                       \
    }                                                                                          \
    EACH(i, 2 * N + 1) EACH(a, size) Y[i][a] -= mean[a];                                       \
    EACH(a, size) EACH(b, a + 1) {                                                             \
        double s = 0.0;                                                                        \
        for (int i = 1; i < 2 * N + 1; i++) s += Y[i][a] * Y[i][b];                            \
        cov[a][b] = cov[b][a] = noise[a][b] + w->each * s + w->first * Y[0][a] * Y[0][b];      \
    }

static inline void predict_points(const model *m, const weights *w, const double u[P],
                                  double x[N], square cov) {
    square L;
    points X, Y;
    root_of(cov, L);
    place(w, x, L, X);
    EACH(i, 2 * N + 1) f(X[i], u, Y[i]);
    SPREAD(N, Y, x, m->Q, cov)
}

/* S = L L' and K S = cross; returns the log-likelihood. */
static inline double gain(double S[M][M], const double e[M], tall cross, tall K) {
    double L[M][M], scaled[M], distance = 0.0, root = 1.0;
    EACH(o, M) {
        EACH(q, o + 1) {
            double s = S[o][q];
            EACH(i, q) s -= L[o][i] * L[q][i];
            L[o][q] = o == q ? sqrt(s) : s / L[q][q];
        }
        scaled[o] = e[o];
        EACH(i, o) scaled[o] -= L[o][i] * scaled[i];
        scaled[o] /= L[o][o];
        distance += scaled[o] * scaled[o];
        root *= L[o][o];
    }
    EACH(a, N) {
        EACH(o, M) {
            K[a][o] = cross[a][o];
            EACH(i, o) K[a][o] -= L[o][i] * K[a][i];
            K[a][o] /= L[o][o];
        }
        for (int o = M - 1; o >= 0; o--) {
            for (int i = o + 1; i < M; i++) K[a][o] -= L[i][o] * K[a][i];
            K[a][o] /= L[o][o];
        }
    }
    return -0.5 * distance - log(root) - M * HALF_LOG_TWO_PI;
}

static inline double correct(kind which, const model *m, const double y[M], const double u[P],
                             double x[N], square cov, double e[M], double S[M][M]) {
    wide jacobian;
    const double(*C)[N] = m->C;
    double expected[M];
    if (which == LINEAR) {
        EACH(o, M) {
            expected[o] = 0.0;
            EACH(p, P) expected[o] += m->D[o][p] * u[p];
            EACH(a, N) expected[o] += C[o][a] * x[a];
        }
    } else {
        h(x, expected);
        H(jacobian);
        C = (const double(*)[N])jacobian;
    }
    tall cross, K, rest;
    EACH(o, M) e[o] = y[o] - expected[o];
    EACH(a, N) EACH(o, M) {
        cross[a][o] = 0.0;
        EACH(b, N) cross[a][o] += cov[a][b] * C[o][b];
    }
    EACH(o, M) EACH(q, o + 1) {
        double s = m->R[o][q];
        EACH(a, N) s += C[o][a] * cross[a][q];
        S[o][q] = S[q][o] = s;
    }
    const double log_likelihood = gain(S, e, cross, K);
    EACH(a, N) EACH(o, M) x[a] += K[a][o] * e[o];
    /* With I - K C, first W = (I - K C) P, then W (I - K C)' + K R K' = W - (W C' - K R) K'. */
    square W;
    EACH(a, N) EACH(b, N) {
        W[a][b] = cov[a][b];
        EACH(o, M) W[a][b] -= K[a][o] * cross[b][o];
    }
    EACH(a, N) EACH(o, M) {
        rest[a][o] = 0.0;
        EACH(b, N) rest[a][o] += W[a][b] * C[o][b];
        EACH(q, M) rest[a][o] -= K[a][q] * m->R[q][o];
    }
    EACH(a, N) EACH(b, a + 1) {
        double s = W[a][b];
        EACH(o, M) s -= rest[a][o] * K[b][o];
        cov[a][b] = cov[b][a] = s;
    }
    return log_likelihood;
}

static inline double correct_points(const model *m, const weights *w, const double y[M],
                                    double x[N], square cov, double e[M], double S[M][M]) {
    square L;
    points X;
    images Y;
    tall cross, K;
    double expected[M];
    root_of(cov, L);
    place(w, x, L, X);
    EACH(i, 2 * N + 1) h(X[i], Y[i]);
    SPREAD(M, Y, expected, m->R, S)
    EACH(o, M) e[o] = y[o] - expected[o];
    EACH(a, N) EACH(o, M) {
        double s = 0.0;
        EACH(i, a + 1) s += L[a][i] * (Y[1 + i][o] - Y[1 + N + i][o]);
        cross[a][o] = w->each * w->spread * s;
    }
    const double log_likelihood = gain(S, e, cross, K);
    /* With r = (X - x) - K (Y - y), sum w r r' + K R K'. */
    EACH(i, 2 * N + 1) EACH(a, N) {
        X[i][a] -= x[a];
        EACH(o, M) X[i][a] -= K[a][o] * Y[i][o];
    }
    EACH(a, N) EACH(o, M) x[a] += K[a][o] * e[o];
    EACH(a, N) EACH(b, a + 1) {
        double s = 0.0;
        for (int i = 1; i < 2 * N + 1; i++) s += X[i][a] * X[i][b];
        s = w->each * s + w->first * X[0][a] * X[0][b];
        EACH(o, M) EACH(q, M) s += K[a][o] * m->R[o][q] * K[b][q];
        cov[a][b] = cov[b][a] = s;
    }
    return log_likelihood;
}

/* Filter a record, whose first row corrects the posterior as it stands; returns how many rows are
 * finite. */
static inline long run(kind which, const model *restrict m, const weights *restrict w,
                       const double *restrict start, const double *restrict y,
                       const double *restrict u, long rows, double *restrict means,
                       double *restrict covariances, double *restrict innovations,
                       double *restrict innovation_covariances,
                       double *restrict log_likelihoods) {
    double x[N];
    square cov, cross;
    memcpy(x, start, sizeof x);
    memcpy(cov, start + N, sizeof cov);
    for (long row = 0; row < rows; row++, y += M, u += P) {
        double *e = innovations + M * row, total;
        double(*S)[M] = (double(*)[M])(innovation_covariances + M * M * row);
        if (row > 0 && which == UNSCENTED) {
            predict_points(m, w, u - P, x, cov);
        } else if (row > 0) {
            double moved[N];
            square ahead;
            predict(which, m, u - P, x, cov, moved, cross, ahead);
            memcpy(x, moved, sizeof x);
            memcpy(cov, ahead, sizeof cov);
        }
        total = log_likelihoods[row] = which == UNSCENTED ? correct_points(m, w, y, x, cov, e, S)
                                                          : correct(which, m, y, u, x, cov, e, S);
        memcpy(means + N * row, x, sizeof x);
        memcpy(covariances + N * N * row, cov, sizeof cov);
        EACH(a, N) total += x[a] + cov[a][a];
        if (!isfinite(total)) return row;
    }
    return rows;
}

/* The smoother of Rauch, Tung and Striebel over a filtered record; returns the row that fails, or
 * -1. */
static inline long smooth(kind which, const model *restrict m, const double *restrict u, long rows,
                          const double *restrict means, const double *restrict covariances,
                          double *restrict smooth_means, double *restrict smooth_covariances) {
    long row = rows - 1;
    memcpy(smooth_means + N * row, means + N * row, sizeof(double[N]));
    memcpy(smooth_covariances + N * N * row, covariances + N * N * row, sizeof(square));
    while (--row >= 0) {
        double moved[N], apart[N], *x = smooth_means + N * row, total = 0.0;
        square cov, cross, ahead, L, G, difference, W;
        double(*after)[N] = (double(*)[N])(smooth_covariances + N * N * (row + 1));
        double(*out)[N] = (double(*)[N])(smooth_covariances + N * N * row);
        memcpy(cov, covariances + N * N * row, sizeof cov);
        predict(which, m, u + P * row, means + N * row, cov, moved, cross, ahead);
        /* G L L' = cross: first G L, then G. */
        root_of(ahead, L);
        EACH(a, N) {
            EACH(i, N) {
                double s = cross[a][i];
                EACH(j, i) s -= L[i][j] * G[a][j];
                G[a][i] = s / L[i][i];
            }
            for (int i = N - 1; i >= 0; i--) {
                double s = G[a][i];
                for (int j = i + 1; j < N; j++) s -= L[j][i] * G[a][j];
                G[a][i] = s / L[i][i];
            }
        }
        EACH(a, N) apart[a] = x[N + a] - moved[a];
        EACH(a, N) EACH(b, N) difference[a][b] = after[a][b] - ahead[a][b];
        EACH(a, N) {
            x[a] = means[N * row + a];
            EACH(i, N) x[a] += G[a][i] * apart[i];
            EACH(b, N) {
                W[a][b] = 0.0;
                EACH(i, N) W[a][b] += G[a][i] * difference[i][b];
            }
        }
        EACH(a, N) EACH(b, a + 1) {
            double s = cov[a][b];
            EACH(i, N) s += W[a][i] * G[b][i];
            out[a][b] = out[b][a] = s;
        }
        EACH(a, N) total += x[a] + out[a][a];
        if (!isfinite(total)) return row;
    }
    return -1;
}

#define RUN(name, which)                                                                       \
    long name(const model *m, const weights *w, const double *start, const double *y,          \
              const double *u, long rows, double *means, double *covariances,                  \
              double *innovations, double *innovation_covariances, double *log_likelihoods) {  \
        return run(which, m, w, start, y, u, rows, means, covariances, innovations,            \
                   innovation_covariances, log_likelihoods);                                   \
    }

#define SMOOTH(name, which)                                                                    \
    long name(const model *m, const double *u, long rows, const double *means,                 \
              const double *covariances, double *smooth_means, double *smooth_covariances) {   \
        return smooth(which, m, u, rows, means, covariances, smooth_means,                     \
                      smooth_covariances);                                                     \
    }

RUN(linear, LINEAR)
RUN(extended, EXTENDED)
RUN(unscented, UNSCENTED)
SMOOTH(smooth_linear, LINEAR)
SMOOTH(smooth_extended, EXTENDED)
