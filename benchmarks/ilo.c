/* The loops of the rigid-body observers in C: what the compiled library is measured against.
 *
 * Sums and products are in the order of the library, and the caller compiles without
 * contraction, so that both give the same numbers. Matrices are rows of nine; a record has
 * two samples a step; what is named `before` are limits from the left.
 */

#include <math.h>

typedef struct {
    double x, y, z;
} vec;

typedef struct {
    double inertia[9], inverse[9], injection[9], input[9], fault[9];
    double first[9];  /* K1 of the learning law, Gamma of the adaptive one */
    double second[9]; /* K2 of the learning law, Kp of the adaptive one */
    double step;
} constants;

typedef struct {
    const double *rate, *rate_before, *control, *control_before;
} record;

static inline vec load(const double *p) { return (vec){p[0], p[1], p[2]}; }

static inline void store(double *p, vec v) { p[0] = v.x, p[1] = v.y, p[2] = v.z; }

static inline vec add(vec a, vec b) { return (vec){a.x + b.x, a.y + b.y, a.z + b.z}; }

static inline vec sub(vec a, vec b) { return (vec){a.x - b.x, a.y - b.y, a.z - b.z}; }

static inline vec ahead(vec w, vec k, double h) {
    return (vec){w.x + h * k.x, w.y + h * k.y, w.z + h * k.z};
}

static inline vec product(const double *m, vec v) {
    return (vec){m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
                 m[6] * v.x + m[7] * v.y + m[8] * v.z};
}

static inline vec acceleration(const constants *c, vec w, vec torque) {
    const vec m = product(c->inertia, w);
    const vec gyroscopic = {w.y * m.z - w.z * m.y, w.z * m.x - w.x * m.z, w.x * m.y - w.y * m.x};
    return product(c->inverse, sub(torque, gyroscopic));
}

static inline double rk4(double w, double a, double b, double c, double d, double weight) {
    return w + weight * (a + 2.0 * b + 2.0 * c + d);
}

static inline vec rk4_sum(vec w, vec a, vec b, vec c, vec d, double h) {
    const double weight = h / 6.0;
    return (vec){rk4(w.x, a.x, b.x, c.x, d.x, weight), rk4(w.y, a.y, b.y, c.y, d.y, weight),
                 rk4(w.z, a.z, b.z, c.z, d.z, weight)};
}

static inline vec slope(const constants *c, vec estimate, vec rate, vec known) {
    return acceleration(c, estimate, add(known, product(c->injection, sub(rate, estimate))));
}

static inline vec known_torque(const constants *c, const double *control, vec learned) {
    return add(product(c->input, load(control)), product(c->fault, learned));
}

static inline vec learn(const constants *c, vec learned, vec rate, vec estimate) {
    return add(learned, product(c->second, sub(rate, estimate)));
}

static inline double middle_of(double w, double after, double first, double last, double eighth) {
    return 0.5 * (w + after) + eighth * (first - last);
}

/* v learns at every instant; `history` holds v at three instants of each of `delay` steps. */
long continuous(const constants *restrict c, record in, long steps, long delay,
                double *restrict estimate, double *restrict history, double *restrict rates,
                double *restrict faults, double *restrict before) {
    const double h = c->step, half = 0.5 * h, eighth = 0.125 * h;
    vec w = load(estimate);
    long slot = 0;
    for (long k = 0; k < steps; k++) {
        double *past = history + 9 * slot;
        const long at = 6 * k;
        const vec start = load(in.rate + at), middle = load(in.rate + at + 3);
        const vec end = load(in.rate_before + at + 6);
        const vec learned_start = product(c->first, load(past));
        const vec learned_middle = product(c->first, load(past + 3));
        const vec learned_end = product(c->first, load(past + 6));
        const vec known_start = known_torque(c, in.control + at, learned_start);
        const vec known_middle = known_torque(c, in.control + at + 3, learned_middle);
        const vec known_end = known_torque(c, in.control_before + at + 6, learned_end);

        const vec k1 = slope(c, w, start, known_start);
        const vec k2 = slope(c, ahead(w, k1, half), middle, known_middle);
        const vec k3 = slope(c, ahead(w, k2, half), middle, known_middle);
        const vec k4 = slope(c, ahead(w, k3, h), end, known_end);
        const vec after = rk4_sum(w, k1, k2, k3, k4, h);
        const vec last = slope(c, after, end, known_end);
        const vec between = {middle_of(w.x, after.x, k1.x, last.x, eighth),
                             middle_of(w.y, after.y, k1.y, last.y, eighth),
                             middle_of(w.z, after.z, k1.z, last.z, eighth)};
        const vec v = learn(c, learned_start, start, w);
        store(past, v);
        const vec v_end = learn(c, learned_end, end, after);
        store(past + 3, learn(c, learned_middle, middle, between));
        store(past + 6, v_end);
        store(rates + 3 * k, w);
        store(faults + 3 * k, v);
        store(before + 3 * k + 3, v_end);
        if (!isfinite(after.x + after.y + after.z)) return k + 1;
        w = after;
        if (++slot == delay) slot = 0;
    }
    store(estimate, w);
    store(rates + 3 * steps, w);
    const vec learned = product(c->first, load(history + 9 * slot));
    store(faults + 3 * steps, learn(c, learned, load(in.rate + 6 * steps), w));
    store(before, load(faults));
    return steps + 1;
}

/* v is updated every `delay` steps and held. */
long sampled(const constants *restrict c, record in, long steps, long delay,
             double *restrict estimate, double *restrict held, double *restrict rates,
             double *restrict faults, double *restrict before) {
    const double h = c->step, half = 0.5 * h;
    vec w = load(estimate), v = load(held);
    long phase = 0;
    for (long k = 0; k < steps; k++) {
        const long at = 6 * k;
        const vec start = load(in.rate + at), middle = load(in.rate + at + 3);
        const vec end = load(in.rate_before + at + 6);
        if (phase == 0) v = learn(c, product(c->first, v), start, w);
        if (++phase == delay) phase = 0;
        const vec known_middle = known_torque(c, in.control + at + 3, v);
        const vec k1 = slope(c, w, start, known_torque(c, in.control + at, v));
        const vec k2 = slope(c, ahead(w, k1, half), middle, known_middle);
        const vec k3 = slope(c, ahead(w, k2, half), middle, known_middle);
        const vec k4 =
            slope(c, ahead(w, k3, h), end, known_torque(c, in.control_before + at + 6, v));
        const vec after = rk4_sum(w, k1, k2, k3, k4, h);
        store(rates + 3 * k, w);
        store(faults + 3 * k, v);
        store(before + 3 * k + 3, v);
        if (!isfinite(after.x + after.y + after.z)) return k + 1;
        w = after;
    }
    store(estimate, w);
    store(held, v);
    if (phase == 0) v = learn(c, product(c->first, v), load(in.rate + 6 * steps), w);
    store(rates + 3 * steps, w);
    store(faults + 3 * steps, v);
    store(before, load(faults));
    return steps + 1;
}

static inline vec adaptive_slope(const constants *c, vec w, vec z, vec rate, vec control) {
    const vec error = sub(rate, w);
    const vec known = add(product(c->injection, error), product(c->input, control));
    return acceleration(c, w, add(known, product(c->fault, z)));
}

/* The fault estimate is an integral z of the error and a share of the error itself. */
long adaptive(const constants *restrict c, record in, long steps, long delay,
              double *restrict estimate, double *restrict memory, double *restrict rates,
              double *restrict faults, double *restrict before) {
    const double h = c->step, half = 0.5 * h;
    vec w = load(estimate), z = load(memory);
    (void)delay; /* no delay here: one signature for all three */
    for (long k = 0;; k++) {
        const long at = 6 * k;
        const vec start = load(in.rate + at);
        store(rates + 3 * k, w);
        store(faults + 3 * k, learn(c, z, start, w));
        store(before + 3 * k, learn(c, z, load(in.rate_before + at), w));
        if (k == steps) break;
        const vec middle = load(in.rate + at + 3), end = load(in.rate_before + at + 6);
        const vec u_middle = load(in.control + at + 3), u_end = load(in.control_before + at + 6);
        const vec k1 = adaptive_slope(c, w, z, start, load(in.control + at));
        const vec l1 = product(c->first, sub(start, w));
        const vec w2 = ahead(w, k1, half);
        const vec k2 = adaptive_slope(c, w2, ahead(z, l1, half), middle, u_middle);
        const vec l2 = product(c->first, sub(middle, w2));
        const vec w3 = ahead(w, k2, half);
        const vec k3 = adaptive_slope(c, w3, ahead(z, l2, half), middle, u_middle);
        const vec l3 = product(c->first, sub(middle, w3));
        const vec w4 = ahead(w, k3, h);
        const vec k4 = adaptive_slope(c, w4, ahead(z, l3, h), end, u_end);
        const vec l4 = product(c->first, sub(end, w4));
        const vec after = rk4_sum(w, k1, k2, k3, k4, h);
        if (!isfinite(after.x + after.y + after.z)) return k + 1;
        w = after;
        z = rk4_sum(z, l1, l2, l3, l4, h);
    }
    store(estimate, w);
    store(memory, z);
    return steps + 1;
}
