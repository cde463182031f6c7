/* Largest exposures of plies and interfaces; included once for each instruction set.
 *
 * Layout.  A state of stress is a ply at one of its faces; four states are computed at once, from the
 * strains of a point, (6,), a table of stresses per strain, (6, 3, width), and the stresses without
 * strain, (3, width).  `width` is the number of states in fours; lanes beyond the last state compute
 * zeros and are not stored.
 *
 * Sums run over the six strains in their order, after the stress without strain.  Of equal exposures of
 * one criterion the first mode stays, and of equal exposures in time the first time.  A call is one thread's.
 *
 * What cannot rise is not evaluated.  Exposures are compared with `keep` times those stored, which is so
 * little below 1 that rounding changes no decision; with a `keep` of 0 all states are evaluated.
 *
 * - Where the midplane is not strained, and without residual stresses, the stresses of a ply are
 *   proportional to z, and so are its exposures.  Of the plies with the same stiffness, on one side of the
 *   midplane, the outermost state then tells whether any exposure rises.  This holds as long as it has held
 *   at all times before: `proportional`, until a midplane strain is not 0.
 * - Otherwise `may_rise` compares four states without roots and quotients.
 */

/* Candidates of four states of stress: exposures, and for Hashin's criterion their squares. */
INLINE void NAME(candidates)(const Limits *p, half s1, half s2, half tau, half *v) {
    const half zero = {0}, one = zero + 1.0;
    const mask pulled = s1 >= 0.0, open = s2 >= 0.0, pressed = s2 < 0.0;
    const half fibre = s1 * p->xt, crushed = s1 * p->xc, t = NAME(size)(tau), ratio = t * p->s12;
    /* Maximum stress. */
    v[0] = fibre, v[1] = crushed, v[2] = s2 * p->yt, v[3] = s2 * p->yc, v[4] = ratio;
    /* Tsai and Wu. */
    const half q = s1 * (s1 * p->xx + p->xy * s2) + s2 * s2 * p->yy + ratio * ratio;
    const half linear = s1 * p->x + s2 * p->y;
    v[5] = 0.5 * (linear + ROOT(linear * linear + 4.0 * q));
    /* Hashin. */
    const half matrix = LARGER(v[2], v[3]), both = matrix * matrix + ratio * ratio;
    v[6] = NAME(choose)(pulled, fibre * fibre + ratio * ratio, zero), v[7] = NAME(choose)(pulled, zero, crushed * crushed);
    v[8] = NAME(choose)(open, both, zero), v[9] = NAME(choose)(pressed, both, zero);
    /* Puck. */
    const half factor = NAME(choose)(pressed, one * p->press, one * p->pull_root) * s2;
    const half ab = ROOT(ratio * ratio + factor * factor) + NAME(choose)(pressed, one * p->press, one * p->pull) * s2;
    const mask steep = pressed & (-s2 * p->critical > t * p->resistance);
    const half c = (t * t * p->shear + s2 * s2 * p->across) / -NAME(choose)(steep, s2, -one);
    v[10] = fibre, v[11] = crushed;
    v[12] = NAME(choose)(pressed, zero, ab), v[13] = NAME(choose)(pressed & ~steep, ab, zero);
    v[14] = NAME(choose)(steep, c, zero);
}

/* Where an exposure of four states of stress may be above a limit F, (CRITERIA,). */
INLINE mask NAME(may_rise)(const Limits *p, half s1, half s2, half tau, const half *F) {
    const half zero = {0}, one = zero + 1.0;
    const half fibre = s1 * p->xt, crushed = s1 * p->xc, along = LARGER(fibre, crushed);
    const half across = LARGER(s2 * p->yt, s2 * p->yc), t = NAME(size)(tau), ratio = t * p->s12;
    const half largest = LARGER(LARGER(along, across), ratio), shear = ratio * ratio;
    mask found = (largest > F[0]) | ((F[0] < TINY) & (largest > 0.0));
    /* f is above F if f^2 - l f - q, whose root it is, is negative at F. */
    const half q = s1 * (s1 * p->xx + p->xy * s2) + s2 * s2 * p->yy + shear, linear = s1 * p->x + s2 * p->y;
    found |= q + linear * F[1] > F[1] * F[1];
    const half pulled = LARGER(fibre, across);
    found |= (crushed > F[2]) | (pulled * pulled + shear > F[2] * F[2]);
    const mask pressed = s2 < 0.0, steep = pressed & (-s2 * p->critical > t * p->resistance);
    const half factor = NAME(choose)(pressed, one * p->press, one * p->pull_root) * s2;
    const half rest = F[3] - NAME(choose)(pressed, one * p->press, one * p->pull) * s2;
    const mask ab = (rest < 0.0) | (shear + factor * factor > rest * rest);
    const mask c = t * t * p->shear + s2 * s2 * p->across > -F[3] * s2;
    return found | (along > F[3]) | (steep & c) | (~steep & ab);
}

/* The outermost states, a bit of each, whose exposures may rise at a point without midplane strains. */
INLINE int64_t NAME(rising)(const Failure *f, const Limits *p, const double *curvature, const double *reached) {
    const int64_t width = f->outer_width;
    int64_t found = 0;
    for (int64_t first = 0; first < width; first += 4) {
        half s[3] = {{0}}, F[CRITERIA];
        const double *stress = f->outer_stress + first;
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++, stress += width) s[c] += curvature[k] * NAME(load)(stress);
        for (int i = 0; i < CRITERIA; i++) F[i] = f->keep * NAME(load)(reached + i * width + first);
        const mask higher = NAME(may_rise)(p, s[0], s[1], s[2], F);
        found |= (int64_t)SIGNS(higher) << first;
    }
    return found;
}

/* Largest candidate of each criterion, and its exposure. */
INLINE void NAME(exposures)(const half *v, half *candidate, half *exposure) {
    const half zero = {0};
#pragma GCC unroll 4
    for (int i = 0; i < CRITERIA; i++) {
        candidate[i] = zero;
#pragma GCC unroll 5
        for (int j = BEGIN[i]; j < BEGIN[i + 1]; j++) candidate[i] = LARGER(v[j], candidate[i]);
        exposure[i] = i == HASHIN ? ROOT(candidate[i]) : candidate[i];
    }
}

/* Store exposures of a criterion that are `higher` than before, with the time and the first mode of equals. */
INLINE void NAME(raise)(const Failure *f, int64_t at, int higher, int criterion, const half *v, half candidate, half exposure, double now) {
    mask mode = {0};
#pragma GCC unroll 5
    for (int i = BEGIN[criterion + 1] - 1; i >= BEGIN[criterion]; i--) {
        const mask first = v[i] == candidate;
        mode = (first & CODES[i]) | (~first & mode);
    }
    if (higher == 15) {
        NAME(store)(f->exposure + at, exposure);
        NAME(store)(f->time + at, (half){now, now, now, now});
        for (int lane = 0; lane < 4; lane++) f->mode[at + lane] = (int8_t)mode[lane];
        return;
    }
    for (int lane = 0; lane < 4; lane++) {
        if (!(higher >> lane & 1)) continue;
        f->exposure[at + lane] = exposure[lane], f->time[at + lane] = now;
        f->mode[at + lane] = (int8_t)mode[lane];
    }
}

TARGET void NAME(failure)(Failure *given, const double *strains, double now) {
    const Failure copy = *given, *const f = &copy; /* which no store changes */
    int64_t proportional = f->proportional;
    const int64_t states = f->states, width = f->width, stride = f->stride, all = f->rows * stride;
    const Limits limits = limits_of(&f->ply);
    for (int64_t point = 0; point < f->points; point++) {
        const int64_t row = f->row ? f->row[point] : point;
        const double *e = strains + 6 * row;
        const int bent = e[0] == 0.0 && e[1] == 0.0 && e[2] == 0.0;
        double *reached = f->reached + CRITERIA * f->outer_width * point;
        if (!bent) proportional = 0;
        const int64_t rising = proportional ? NAME(rising)(f, &limits, e + 3, reached) : 0;
        if (proportional && !rising) continue;
        half largest[CRITERIA] = {{0}};
        for (int64_t first = 0; first < width; first += 4) {
            if (proportional && !(rising & f->stands[first / 4])) continue;
            const int64_t at = row * stride + f->first + first;
            const int count = states - first < 4 ? (int)(states - first) : 4;
            half s[3], before[CRITERIA], F[CRITERIA], v[CANDIDATES], candidate[CRITERIA], exposure[CRITERIA];
#pragma GCC unroll 4
            for (int i = 0; i < CRITERIA; i++) {
                before[i] = (half){HUGE_VAL, HUGE_VAL, HUGE_VAL, HUGE_VAL};
                if (count == 4)
                    before[i] = NAME(load)(f->exposure + i * all + at);
                else
                    memcpy(before + i, f->exposure + i * all + at, sizeof(double) * count);
                F[i] = f->keep * before[i];
            }
            for (int c = 0; c < 3; c++) s[c] = NAME(load)(f->residual + c * width + first);
            const double *stress = f->in_plane + first + (bent ? 9 * width : 0);
            for (int k = bent ? 3 : 0; k < 6; k++)
                for (int c = 0; c < 3; c++, stress += width) s[c] += e[k] * NAME(load)(stress);
            if (f->keep > 0.0 && !proportional) {
                const mask higher = NAME(may_rise)(&limits, s[0], s[1], s[2], F);
                if (!SIGNS(higher)) continue;
            }
            NAME(candidates)(&limits, s[0], s[1], s[2], v);
            NAME(exposures)(v, candidate, exposure);
#pragma GCC unroll 4
            for (int i = 0; i < CRITERIA; i++) {
                const mask higher = exposure[i] > before[i];
                const int which = SIGNS(higher);
                if (!which) continue;
                largest[i] = LARGER(exposure[i], largest[i]);
                NAME(raise)(f, i * all + at, which, i, v, candidate[i], exposure[i], now);
            }
        }
        for (int i = 0; i < CRITERIA; i++) {
            const mask raised = largest[i] > 0.0;
            if (!SIGNS(raised)) continue;
            double *peak = f->peak + i * f->rows + row;
            for (int lane = 0; lane < 4; lane++)
                if (largest[i][lane] > *peak) *peak = largest[i][lane];
            if (!proportional) continue;
            const double *stored = f->exposure + i * all + row * stride + f->first;
            for (int64_t n = 0; n < f->outermost; n++) reached[i * f->outer_width + n] = stored[f->outer[n]];
        }
    }
    given->proportional = proportional;
}

/* Interlaminar exposures; NaN where the gradients or a strength are not known. */
TARGET void NAME(interfaces)(const Interfaces *f, const double *gradients, double now) {
    for (int64_t element = 0; element < f->elements; element++) {
        const int64_t row = f->row ? f->row[element] : element;
        const double *g = gradients + 12 * row;
        for (int64_t first = 0; first < f->interfaces; first += 4) {
            half t[4] = {{0}};
            const double *shear = f->shear + first;
            for (int k = 0; k < 12; k++)
                for (int i = 0; i < 4; i++, shear += f->width) t[i] += g[k] * NAME(load)(shear);
            const half above = ROOT(t[0] * t[0] + t[1] * t[1]), below = ROOT(t[2] * t[2] + t[3] * t[3]);
            const half larger = LARGER(above, below);
            for (int lane = 0; lane < 4 && first + lane < f->interfaces; lane++) {
                const int64_t at = f->stride * row + first + lane;
                if (isnan(above[lane]) || isnan(below[lane]))
                    f->exposure[at] = NAN;
                else if (larger[lane] > f->exposure[at])
                    f->exposure[at] = larger[lane], f->time[at] = now, f->mode[at] = (int8_t)f->code;
            }
        }
    }
}
