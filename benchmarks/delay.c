/* The loops of the paper on delays in C: what the compiled library is measured against.
 *
 * A pendulum (n = 2) and the extended high-gain observer with m = 2, written for these sizes: C
 * knows the model and the lengths of all loops, the library is handed them. Sums and products are
 * in the order of the library, and the caller compiles without contraction.
 */

#include <math.h>
#include <stdbool.h>

enum { STATES = 2, SIZE = STATES + 1, ORDER = 2, GAINS = 2 + ORDER, CHANNELS = GAINS + SIZE };
enum { CHANGES = 16, BISECTIONS = 60 };

typedef struct {
    double swing, damping, torque; /* g / l, k / m, 1 / (m l^2) */
    double step, least, most, threshold;
} constants;

typedef struct {
    double v[CHANNELS];
} inputs;

typedef struct {
    double v[SIZE];
} point;

typedef struct {
    int held; /* the delay is at its lower bound: -1, free: 0, at its upper bound: 1 */
    bool off; /* its gain is switched off */
} mode;

static inline double acceleration(const constants *c, double angle, double rate) {
    return -c->swing * sin(angle) - c->damping * rate;
}

/* `in` holds the delayed input at the start, the middle and the end of the steps. */
long plant(const constants *restrict c, const double *restrict in, long steps,
           double *restrict states) {
    const double h = c->step, half = 0.5 * h, g = c->torque;
    double x = states[0], v = states[1];
    for (long k = 0; k < steps; k++) {
        const double first = in[k], middle = in[steps + k], last = in[2 * steps + k];
        const double v1 = v, a1 = acceleration(c, x, v1) + g * first;
        const double v2 = v + half * a1, a2 = acceleration(c, x + half * v1, v2) + g * middle;
        const double v3 = v + half * a2, a3 = acceleration(c, x + half * v2, v3) + g * middle;
        const double v4 = v + h * a3, a4 = acceleration(c, x + h * v3, v4) + g * last;
        x += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4);
        v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
        if (!isfinite(x) || !isfinite(v)) return k;
        states[2 * k + 2] = x, states[2 * k + 3] = v;
    }
    return steps;
}

static inline inputs load(const double *row) {
    inputs in;
    for (int i = 0; i < CHANNELS; i++) in.v[i] = row[i];
    return in;
}

static inline inputs between(const inputs in[3], double theta) {
    const double first = 2.0 * (theta - 0.5) * (theta - 1.0);
    const double middle = 4.0 * theta * (1.0 - theta), last = 2.0 * theta * (theta - 0.5);
    inputs found;
    for (int i = 0; i < CHANNELS; i++)
        found.v[i] = first * in[0].v[i] + middle * in[1].v[i] + last * in[2].v[i];
    return found;
}

/* xi^ of (10) */
static inline double seen(const constants *c, double delay, const inputs *in) {
    double total = 0.0, factor = -1.0;
    for (int i = 1; i <= ORDER; i++) {
        total += factor * in->v[1 + i];
        factor *= -delay / (i + 1);
    }
    return c->torque * total;
}

static inline double raw_rate(point X, double xi, const inputs *in) {
    return -in->v[CHANNELS - 1] * (X.v[0] - in->v[0]) / xi;
}

static inline mode mode_of(const constants *c, point *X, double xi, const inputs *in) {
    double *delay = &X->v[STATES];
    *delay = fmin(fmax(*delay, c->least), c->most);
    if (fabs(xi) < c->threshold) return (mode){0, true};
    if (*delay == c->most && raw_rate(*X, xi, in) > 0.0) return (mode){1, false};
    if (*delay == c->least && raw_rate(*X, xi, in) < 0.0) return (mode){-1, false};
    return (mode){0, false};
}

static inline bool holds(const constants *c, point X, double xi, const inputs *in, mode now) {
    if ((fabs(xi) < c->threshold) != now.off) return false;
    if (now.off) return true;
    if (now.held == 0) return c->least <= X.v[STATES] && X.v[STATES] <= c->most;
    return now.held * raw_rate(X, xi, in) >= 0.0;
}

static inline point slope(const constants *c, point x, const inputs *in, mode now) {
    const double xi = seen(c, x.v[2], in), error = x.v[0] - in->v[0];
    const double pushed = xi * x.v[2] + c->torque * in->v[1];
    point k;
    k.v[0] = x.v[1] - in->v[GAINS] * error;
    k.v[1] = acceleration(c, x.v[0], x.v[1]) + pushed - in->v[GAINS + 1] * error;
    k.v[2] = now.held == 0 && !now.off ? -in->v[GAINS + 2] * error / xi : 0.0;
    return k;
}

static inline point ahead(point X, double h, point k) {
    for (int i = 0; i < SIZE; i++) X.v[i] += h * k.v[i];
    return X;
}

static inline point runge_kutta(const constants *c, point X, double h, const inputs *in, mode now) {
    const point a = slope(c, X, &in[0], now), b = slope(c, ahead(X, 0.5 * h, a), &in[1], now);
    const point d = slope(c, ahead(X, 0.5 * h, b), &in[1], now);
    const point e = slope(c, ahead(X, h, d), &in[2], now);
    for (int i = 0; i < SIZE; i++)
        X.v[i] += h / 6.0 * (a.v[i] + 2.0 * b.v[i] + 2.0 * d.v[i] + e.v[i]);
    return X;
}

static point part(const constants *c, point X, const inputs in[3], double start, double end,
                  mode now) {
    if (start == 0.0 && end == 1.0) return runge_kutta(c, X, c->step, in, now);
    const inputs cut[3] = {between(in, start), between(in, start + 0.5 * (end - start)),
                           between(in, start + (end - start))};
    return runge_kutta(c, X, (end - start) * c->step, cut, now);
}

/* Goes on to the end of the step, or to where the mode ends; returns where. */
static inline double to_mode_end(const constants *c, point X, const inputs in[3], double start,
                                 mode now, double rate, point *out) {
    double high = 1.0;
    bool good = true;
    for (int attempt = 0; attempt < 2; attempt++) {
        *out = part(c, X, in, start, high, now);
        const inputs last = high < 1.0 ? between(in, high) : in[2];
        const double xi = seen(c, out->v[STATES], &last);
        good = holds(c, *out, xi, &last, now);
        const double after = rate == 0.0 ? rate : raw_rate(*out, xi, &last);
        if (attempt == 1 || !good || rate * after >= 0.0) break;
        high = start + (1.0 - start) * rate / (rate - after);
    }
    if (good && high == 1.0) return high;
    if (good) {
        high = 1.0;
    } else {
        double low = start;
        for (int i = 0; i < BISECTIONS; i++) {
            const double middle = 0.5 * (low + high);
            if (!(low < middle && middle < high)) break;
            *out = part(c, X, in, start, middle, now);
            const inputs there = between(in, middle);
            if (holds(c, *out, seen(c, out->v[STATES], &there), &there, now))
                low = middle;
            else
                high = middle;
        }
    }
    *out = part(c, X, in, start, high, now);
    return high;
}

/* Two rows of `right` and `left` a step: y, u, u', u'' and three gains. */
long observer(const constants *restrict c, const double *restrict right,
              const double *restrict left, long steps, double *restrict states,
              double *restrict switched_off) {
    point X = {{states[0], states[1], states[2]}};
    for (long k = 0; k < steps; k++) {
        const double *row = right + 2 * k * CHANNELS;
        const inputs in[3] = {load(row), load(row + CHANNELS), load(left + (2 * k + 2) * CHANNELS)};
        inputs here = in[0];
        double start = 0.0, off = 0.0;
        for (int change = 0; change < CHANGES; change++) {
            const double xi = seen(c, X.v[STATES], &here);
            const mode now = mode_of(c, &X, xi, &here);
            const double rate = now.off || now.held != 0 ? 0.0 : raw_rate(X, xi, &here);
            double end = 1.0;
            point out;
            if (change < CHANGES - 1)
                end = to_mode_end(c, X, in, start, now, rate, &out);
            else
                out = part(c, X, in, start, end, now);
            if (now.off) off += end - start;
            X = out;
            for (int i = 0; i < SIZE; i++)
                if (!isfinite(X.v[i])) return k + 1;
            if (end == 1.0) break;
            start = end;
            here = between(in, end);
        }
        X.v[STATES] = fmin(fmax(X.v[STATES], c->least), c->most);
        for (int i = 0; i < SIZE; i++) states[SIZE * (k + 1) + i] = X.v[i];
        switched_off[k] = off;
    }
    return steps + 1;
}
