/* Largest exposures of plies and interfaces; included once for each instruction set.
 *
 ** Layout.  A state of stress is a face of a ply.  Four states are computed at once, from the strains of a
 * point, (strains,), a table of stresses per strain, (strains, 3, width), and the stresses without strain,
 * (3, width); `width` is the number of states padded to a multiple of four.  If the number is not a multiple of
 * four, the last four states overlap the four before.  With fewer than four states, the other lanes compute
 * zeros and are not stored.  Python decides which states there are: where exposures are proportional to z, one
 * state represents many.
 *
 * Sums run over the strains in their order, after the stress without strain.  Ties between modes of a criterion
 * go to the first mode, ties in time to the first time, and ties between the largest exposures of the plate to
 * the lowest number.  A call runs in one thread.
 *
 * States that cannot rise are not evaluated.  `may_rise` compares four states, without roots and quotients,
 * with KEEP times the stored exposures.  The margin of KEEP is so large that rounding changes no decision.
 */

/* Candidates of four states of stress: exposures, or squares of exposures for Hashin's criterion. */
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

/* Mask of the states whose exposure may be above a limit F, (CRITERIA,). */
INLINE mask NAME(may_rise)(const Limits *p, half s1, half s2, half tau, const half *F) {
    const half zero = {0}, one = zero + 1.0;
    const half fibre = s1 * p->xt, crushed = s1 * p->xc, along = LARGER(fibre, crushed);
    const half across = LARGER(s2 * p->yt, s2 * p->yc), t = NAME(size)(tau), ratio = t * p->s12;
    const half largest = LARGER(LARGER(along, across), ratio), shear = ratio * ratio;
    mask found = (largest > F[0]) | ((F[0] < TINY) & (largest > 0.0));
    /* f is a root of f^2 - l f - q; f is above F if the polynomial is negative at F. */
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

/* Largest candidate of each criterion, and the exposure. */
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

/* `count` stored exposures in four lanes; the other lanes are infinite.  `count` is 0 for a criterion that is not
 * evaluated. */
INLINE half NAME(stored)(const double *exposure, int count) {
    if (count == 4) return NAME(load)(exposure);
    half found = {HUGE_VAL, HUGE_VAL, HUGE_VAL, HUGE_VAL};
    for (int lane = 0; lane < count; lane++) found[lane] = exposure[lane];
    return found;
}

/* Start of four states at `first`, or earlier so that no state is beyond the last of `count`. */
INLINE int64_t NAME(first_of_four)(int64_t first, int64_t count) {
    return first + 4 > count && count >= 4 ? count - 4 : first;
}

/* Make an exposure the largest of a criterion if it is larger, or if it ties and has a lower number. */
INLINE void NAME(follow)(const Largest *largest, int64_t criterion, double exposure, int64_t state, int8_t mode, const double *strain, int64_t strains) {
    const double before = largest->exposure[criterion];
    const int higher = !(exposure <= before * (1.0 + TIE));
    if (!(higher || (exposure >= before * (1.0 - TIE) && state <= largest->state[criterion]))) return;
    largest->exposure[criterion] = exposure;
    largest->state[criterion] = state;
    largest->mode[criterion] = mode;
    if (strain) memcpy(largest->strain + 6 * criterion + 6 - strains, strain, sizeof(double) * strains);
}

/* Store the exposures of a criterion that are `higher` than before, with the time and the first of tied modes. */
INLINE void NAME(raise)(const Maxima *m, int64_t at, int higher, int criterion, const half *v, half candidate, half exposure, double now) {
    mask mode = {0};
#pragma GCC unroll 5
    for (int i = BEGIN[criterion + 1] - 1; i >= BEGIN[criterion]; i--) {
        const mask first = v[i] == candidate;
        mode = (first & CODES[i]) | (~first & mode);
    }
    if (higher == 15) {
        NAME(store)(m->exposure + at, exposure);
        NAME(store)(m->time + at, (half){now, now, now, now});
        for (int lane = 0; lane < 4; lane++) m->mode[at + lane] = (int8_t)mode[lane];
        return;
    }
    for (int lane = 0; lane < 4; lane++) {
        if (!(higher >> lane & 1)) continue;
        m->exposure[at + lane] = exposure[lane], m->time[at + lane] = now;
        m->mode[at + lane] = (int8_t)mode[lane];
    }
}

/* Raise the exposures of four states of stress at a point; the arrays have `count` of them. */
INLINE void NAME(four_states)(const Exposures *m, const Limits *limits, int prunes, int pucks, int64_t point, int64_t state, int count, half s1, half s2, half tau, double now) {
    const int64_t all = m->points * m->states, at = point * m->states + state;
    const Maxima *plies = &m->plies;
    half before[CRITERIA], F[CRITERIA], v[CANDIDATES], candidate[CRITERIA], exposure[CRITERIA];
#pragma GCC unroll 4
    for (int i = 0; i < CRITERIA; i++) {
        before[i] = NAME(stored)(plies->exposure + i * all + at, i == PUCK && !pucks ? 0 : count);
        F[i] = KEEP * before[i];
    }
    if (prunes) {
        const mask higher = NAME(may_rise)(limits, s1, s2, tau, F);
        if (!SIGNS(higher)) return;
    }
    NAME(candidates)(limits, s1, s2, tau, v);
    NAME(exposures)(v, candidate, exposure);
#pragma GCC unroll 4
    for (int i = 0; i < CRITERIA; i++) {
        const mask higher = exposure[i] > before[i] * (1.0 + TIE);
        const mask largest = higher & ~(exposure[i] < m->largest.exposure[i] * (1.0 - TIE));
        const int which = SIGNS(higher);
        if (!which) continue;
        NAME(raise)(plies, i * all + at, which, i, v, candidate[i], exposure[i], now);
        if (!SIGNS(largest) || !m->counts[point]) continue;
        for (int lane = 0; lane < 4; lane++)
            if (which >> lane & 1)
                NAME(follow)(&m->largest, i, exposure[i][lane], at + lane, plies->mode[i * all + at + lane], m->strain + m->strains * point, m->strains);
    }
}

/* Raise the exposures of plies of the same strengths. */
INLINE void NAME(plies)(const Exposures *m, const Plies *f, int strains, double now) {
    const int64_t width = f->width;
    const Limits limits = limits_of(&f->ply);
    double least = HUGE_VAL; /* of the largest exposures */
    for (int i = 0; i < CRITERIA; i++) least = isnan(m->largest.exposure[i]) ? 0.0 : fmin(least, m->largest.exposure[i]);
    for (int64_t point = 0; point < f->points; point++) {
        const int64_t row = f->row ? f->row[point] : point;
        const double *e = m->strain + strains * row;
        if (f->bound) {
            double most = f->rest;
            for (int k = 0; k < strains; k++) most += fabs(e[k]) * f->bound[k];
            if (!m->counts[row] || most < KEEP * least) continue;
        }
        for (int64_t four = 0; four < f->states; four += 4) {
            const int64_t first = NAME(first_of_four)(four, f->states);
            half s[3];
            for (int c = 0; c < 3; c++) s[c] = NAME(load)(f->residual + c * width + first);
            const double *stress = f->stress + first;
            for (int k = 0; k < strains; k++)
                for (int c = 0; c < 3; c++, stress += width) s[c] += e[k] * NAME(load)(stress);
            NAME(four_states)(m, &limits, (int)f->prunes, (int)f->pucks, row, f->first + first, f->states < 4 ? (int)f->states : 4, s[0], s[1], s[2], now);
        }
    }
}

/* Raise the interlaminar exposures; they are NaN where the gradients or a strength are unknown. */
INLINE void NAME(interfaces)(const Exposures *m, const Interfaces *f, int strains, double now) {
    const Maxima *between = &m->between;
    const int count = f->interfaces < 4 ? (int)f->interfaces : 4;
    for (int64_t element = 0; element < f->elements; element++) {
        const int64_t row = f->row ? f->row[element] : element;
        const double *g = m->gradient + 2 * strains * row;
        for (int64_t four = 0; four < f->interfaces; four += 4) {
            const int64_t first = NAME(first_of_four)(four, f->interfaces), at = m->interfaces * row + first;
            const half before = NAME(stored)(between->exposure + at, count);
            half t[4] = {{0}};
            const double *shear = f->shear + first;
            for (int k = 0; k < 2 * strains; k++)
                for (int i = 0; i < 4; i++, shear += f->width) t[i] += g[k] * NAME(load)(shear);
            const half above = t[0] * t[0] + t[1] * t[1], below = t[2] * t[2] + t[3] * t[3];
            const half F = KEEP * before;
            const mask as_before = (above <= F * F) & (below <= F * F);
            if (SIGNS(as_before) == 15) continue;
            const half larger = ROOT(LARGER(above, below));
            for (int lane = 0; lane < count; lane++) {
                if (isnan(above[lane]) || isnan(below[lane]))
                    between->exposure[at + lane] = NAN;
                else if (larger[lane] > before[lane] * (1.0 + TIE)) {
                    between->exposure[at + lane] = larger[lane], between->time[at + lane] = now;
                    between->mode[at + lane] = (int8_t)f->code;
                    if (m->far[row])
                        NAME(follow)(&m->largest, m->criteria - 1, larger[lane], at + lane, (int8_t)f->code, NULL, 0);
                }
            }
        }
    }
}

/* Largest absolute principal strain of both faces. */
INLINE double NAME(largest_face)(const Exposures *m, double largest) {
    for (int64_t point = 0; point < m->points; point++) {
        const double *e = m->strain + 6 * point, half = m->half[point];
        for (int side = -1; side < 2 && half > 0.0; side += 2) {
            const double z = side * half, xx = e[0] + z * e[3], yy = e[1] + z * e[4], xy = e[2] + z * e[5];
            const double size = 0.5 * (fabs(xx + yy) + sqrt((xx - yy) * (xx - yy) + xy * xy));
            if (size > largest) largest = size;
        }
    }
    return largest;
}

INLINE void NAME(evaluate)(const Exposures *m, const double *u, int strains, double now) {
    if (!m->families) memcpy(m->strain, u, sizeof *u * strains * m->points);
    for (int64_t i = 0; i < m->families; i++) NAME(midplane)(m->family + i, u, strains, m->strain, m->gradient);
    if (m->half) *m->face = NAME(largest_face)(m, *m->face);
    for (int64_t i = 0; i < m->runs; i++) NAME(plies)(m, m->run + i, strains, now);
    for (int64_t i = 0; i < m->zones; i++) NAME(interfaces)(m, m->zone + i, strains, now);
}

/* Raise the exposures to the exposures of a displacement field, (numnp, 5); without families to those of the
 * strains at the points, (points, strains). */
TARGET void NAME(failure)(const Exposures *m, const double *u, double now) {
    if (m->strains == 6)
        NAME(evaluate)(m, u, 6, now);
    else
        NAME(evaluate)(m, u, 3, now);
}
