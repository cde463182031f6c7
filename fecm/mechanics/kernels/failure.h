/* Largest exposures of plies, with FailureMonitor's arithmetic; included once for each instruction set.
 *
 * Layout.  A state of stress is a ply at one of its faces; four states are computed at once, from the
 * strains of a point, (6,), a table of stresses per strain, (6, 3, width), and the stresses without
 * strain, (3, width).  `width` is the number of states in fours; lanes beyond the last state compute
 * zeros and are not stored.
 *
 * Sums run over the six strains in their order, after the stress without strain.  Of equal exposures of one criterion the first mode
 * stays, and of equal exposures in time the first time.  A call is one thread's.
 */

/* Largest of some candidates, the first of equals, and the codes of their modes. */
typedef struct {
    half exposure, mode;
} NAME(Worst);

INLINE void NAME(admit)(NAME(Worst) *w, half candidate, double mode) {
    const mask larger = candidate > w->exposure;
    w->exposure = NAME(choose)(larger, candidate, w->exposure);
    w->mode = NAME(choose)(larger, (half){mode, mode, mode, mode}, w->mode);
}

/* Exposures of four states of stress by each criterion; modes are indices of MODES. */
INLINE void NAME(criteria)(const Ply *p, half s1, half s2, half tau, NAME(Worst) *w) {
    const half zero = {0}, one = zero + 1.0;
    const mask pulled = s1 >= 0.0, open = s2 >= 0.0, pressed = s2 < 0.0;
    const half fibre = s1 * (1.0 / p->xt), crushed = s1 * (-1.0 / p->xc);
    const half t = NAME(size)(tau), ratio = t * (1.0 / p->s12);
    for (int i = 0; i < CRITERIA; i++) w[i] = (NAME(Worst)){zero, zero};
    /* Maximum stress. */
    NAME(admit)(w, fibre, 1), NAME(admit)(w, crushed, 2);
    NAME(admit)(w, s2 * (1.0 / p->yt), 3), NAME(admit)(w, s2 * (-1.0 / p->yc), 4), NAME(admit)(w, ratio, 5);
    /* Tsai and Wu. */
    const double x = p->xt * p->xc, y = p->yt * p->yc;
    const half q = s1 * (s1 * (1.0 / x) + 2.0 * p->f12 / sqrt(x * y) * s2) + s2 * s2 * (1.0 / y) + ratio * ratio;
    const half linear = s1 * (1.0 / p->xt - 1.0 / p->xc) + s2 * (1.0 / p->yt - 1.0 / p->yc);
    NAME(admit)(w + 1, 0.5 * (linear + ROOT(linear * linear + 4.0 * q)), 6);
    /* Hashin. */
    const half matrix = s2 * NAME(choose)(open, one * (1.0 / p->yt), one * (1.0 / p->yc));
    const half both = ROOT(matrix * matrix + ratio * ratio);
    NAME(admit)(w + 2, NAME(choose)(pulled, ROOT(fibre * fibre + ratio * ratio), zero), 1);
    NAME(admit)(w + 2, crushed, 2);
    NAME(admit)(w + 2, NAME(choose)(open, both, zero), 3), NAME(admit)(w + 2, NAME(choose)(pressed, both, zero), 4);
    /* Puck. */
    const double s = p->s12, slope = p->p_minus * p->resistance / s, wide = 2.0 * (1.0 + slope) * s;
    const half press = one * (p->p_minus / s);
    const half factor = NAME(choose)(pressed, press, one * (1.0 / p->yt - p->p_plus / s)) * s2;
    const half ab = ROOT(ratio * ratio + factor * factor) + NAME(choose)(pressed, press, one * (p->p_plus / s)) * s2;
    const mask steep = pressed & (-s2 * p->critical > t * p->resistance);
    const half c = (t * t * (p->yc / (wide * wide)) + s2 * s2 * (1.0 / p->yc)) / -NAME(choose)(steep, s2, -one);
    NAME(admit)(w + 3, fibre, 1), NAME(admit)(w + 3, crushed, 2);
    NAME(admit)(w + 3, NAME(choose)(pressed, zero, ab), 7), NAME(admit)(w + 3, NAME(choose)(pressed & ~steep, ab, zero), 8);
    NAME(admit)(w + 3, NAME(choose)(steep, c, zero), 9);
}

TARGET void NAME(failure)(const Failure *f, const double *strains, double now) {
    const int64_t states = f->states, width = f->width, stride = f->stride, all = f->rows * stride;
    const Ply ply = f->ply; /* a copy, which no store changes */
    for (int64_t point = 0; point < f->points; point++) {
        const int64_t row = f->row ? f->row[point] : point;
        const double *e = strains + 6 * row;
        for (int64_t first = 0; first < width; first += 4) {
            half s[3];
            for (int c = 0; c < 3; c++) s[c] = NAME(load)(f->residual + c * width + first);
            const double *stress = f->in_plane + first;
            for (int k = 0; k < 6; k++)
                for (int c = 0; c < 3; c++, stress += width) s[c] += e[k] * NAME(load)(stress);
            NAME(Worst) w[CRITERIA];
            NAME(criteria)(&ply, s[0], s[1], s[2], w);
            const int count = states - first < 4 ? (int)(states - first) : 4;
            for (int i = 0; i < CRITERIA; i++) {
                const int64_t at = i * all + row * stride + f->first + first;
                if (count == 4 && !NAME(any)(w[i].exposure > NAME(load)(f->exposure + at))) continue;
                for (int lane = 0; lane < count; lane++)
                    if (w[i].exposure[lane] > f->exposure[at + lane]) {
                        f->exposure[at + lane] = w[i].exposure[lane], f->time[at + lane] = now;
                        f->mode[at + lane] = (int8_t)w[i].mode[lane];
                    }
            }
        }
    }
}
