/* Many impacts on one plate, eight cases at a time; included once for each instruction set.
 *
 ** Plate and projectile are linear.  The displacement w of the plate and the acceleration of the tip
 * are convolutions of the earlier contact forces of a case with `response`, the responses to a unit force:
 * w_n = sum over m < n of g_(n-m) F_m.  The force of a step follows from w by the contact iteration.
 *
 * Layout.  Cases are computed in GROUPS of four, one case per lane.  The groups' chains of divisions and roots
 * overlap, and the groups share the numbers that they load.  Lanes beyond the last case repeat it.  Response and
 * spectra interleave plate and tip, (.., 2), so that both sums are one complex transform: the plate is the real
 * part, the tip the imaginary part, divided by `unit` to have the same size.
 *
 * Sums.  Steps are cut into blocks of FAR.  Forces of earlier blocks act by Fourier transforms of
 * 2 FAR numbers, once per block (far_sums); blocks without a force are left out.  Forces of the current block
 * act one by one (near_sums).  Both sums run over the past in a fixed order, and no lane reads another lane, so
 * that the result of a case does not depend on the other cases, to the last bit.
 *
 * After every CHECKED steps the modes of the projectile are advanced, by a power of the step's matrix and
 * the forces since, and the energies are compared.  The result of a case is its largest error.
 *
 * Threads.  A call runs in one thread; several processes share a sweep.
 */

INLINE half NAME(choose)(mask where, half a, half b) { return (half)((where & (mask)a) | (~where & (mask)b)); }
INLINE half NAME(size)(half x) { return (half)((mask)x & INT64_MAX); }

/* Whether a lane of any group is set. */
INLINE int NAME(any)(const mask *where) {
    mask found = where[0];
    for (int g = 1; g < GROUPS; g++) found |= where[g];
    return ANY(found);
}

/* Butterfly of a Fourier transform: u + v, and u - v turned back. */
INLINE void NAME(part)(half *u, half *v, const double *turn) {
    const double c = turn[0], s = turn[1];
    const half re = u[0] - v[0], im = u[1] - v[1];
    u[0] += v[0], u[1] += v[1];
    v[0] = c * re + s * im, v[1] = c * im - s * re;
}

/* Inverse of `part`, times 2. */
INLINE void NAME(join)(half *u, half *v, const double *turn) {
    const double c = turn[0], s = turn[1];
    const half re = c * v[0] - s * v[1], im = c * v[1] + s * v[0];
    v[0] = u[0] - re, v[1] = u[1] - im;
    u[0] += re, u[1] += im;
}

/* Fourier transform of `count` numbers (re, im); `count` is a power of two up to 2 FAR.  Frequencies are in
 * bit-reversed order.  Two stages at a time halve the number of loads and stores. */
TARGET void NAME(transform)(half *z, int count, const double *turn) {
    int width = count / 2, step = 2 * FAR / count;
    for (; width > 1; width /= 4, step *= 4)
        for (half *first = z; first < z + 2 * count; first += 4 * width)
            for (int i = 0; i < width / 2; i++) {
                half *at = first + 2 * i, u[4][2];
                for (int k = 0; k < 4; k++) u[k][0] = at[k * width], u[k][1] = at[k * width + 1];
                NAME(part)(u[0], u[2], turn + 2 * i * step);
                NAME(part)(u[1], u[3], turn + 2 * (i + width / 2) * step);
                NAME(part)(u[0], u[1], turn + 4 * i * step);
                NAME(part)(u[2], u[3], turn + 4 * i * step);
                for (int k = 0; k < 4; k++) at[k * width] = u[k][0], at[k * width + 1] = u[k][1];
            }
    if (width)
        for (half *first = z; first < z + 2 * count; first += 4) NAME(part)(first, first + 2, turn);
}

/* Fourier transform of 2 FAR real numbers, at half of the places: for n <= i < 2 n, with n a power of two, place
 * 3 n - 1 - i has the opposite frequency of place i, and only the smaller place is computed. */
TARGET void NAME(transform_real)(half *z, const double *turn) {
    for (int width = FAR, step = 1; width > 1; width /= 2, step *= 2) {
        for (int i = 0; i < width / 2; i++) {
            half *u = z + 2 * i, *v = u + width, *w = v + width, *x = w + width;
            NAME(part)(u, w, turn + 2 * i * step);
            NAME(part)(v, x, turn + 2 * (i + width / 2) * step);
            w[0] += x[0], w[1] += x[1]; /* the next stage; w - x would give the other half */
        }
        NAME(transform)(z + 2 * width, width / 2, turn);
    }
    NAME(part)(z, z + 2, turn);
}

/* First FAR numbers of the inverse transform, times 2 FAR. */
TARGET void NAME(restore)(half *z, const double *turn) {
    for (int width = 1, step = FAR; width < FAR; width *= 4, step /= 4)
        for (half *first = z; first < z + 4 * FAR; first += 8 * width)
            for (int i = 0; i < width; i++) {
                half *at = first + 2 * i, u[4][2];
                for (int k = 0; k < 4; k++) u[k][0] = at[2 * k * width], u[k][1] = at[2 * k * width + 1];
                NAME(join)(u[0], u[1], turn + 2 * i * step);
                NAME(join)(u[2], u[3], turn + 2 * i * step);
                NAME(join)(u[0], u[2], turn + i * step);
                NAME(join)(u[1], u[3], turn + (i + width) * step);
                for (int k = 0; k < 4; k++) at[2 * k * width] = u[k][0], at[2 * k * width + 1] = u[k][1];
            }
}

/* Spectra (2 FAR, blocks - 1, 2) of the responses 1, 2, ... blocks after a block of forces. */
TARGET void NAME(filters)(const Sweep *x, const Response *r) {
    const int64_t count = (x->steps - 1) / FAR;
    for (int64_t first = 0; first < count; first += WIDTH) {
        half *z = r->work;
        memset(z, 0, sizeof(half) * 4 * FAR);
        for (int64_t lane = 0; lane < WIDTH; lane++)
            for (int64_t i = 1 - FAR; i < FAR; i++) {
                const int64_t n = (first + lane + 1) * FAR + i - 1;
                if (n >= x->steps) break;
                for (int part = 0; part < 2; part++)
                    z[2 * (i < 0 ? i + 2 * FAR : i) + part][lane] = r->response[2 * n + part] / (2 * FAR);
            }
        NAME(transform)(z, 2 * FAR, r->turn);
        for (int64_t lane = 0; lane < WIDTH && first + lane < count; lane++)
            for (int64_t i = 0; i < 4 * FAR; i++)
                r->filter[2 * (i / 2 * r->spaced + first + lane) + i % 2] = z[i][lane];
    }
}

/* Spectrum of the sums over earlier blocks at two places of opposite frequencies, or at a place that is its own
 * opposite. */
INLINE void NAME(far_places)(const Response *r, int64_t block, int64_t used, int place, int other) {
    const int64_t row = 2 * GROUPS * r->spaced;
    const double *filter = r->filter + 2 * place * r->spaced, *opposite_filter = r->filter + 2 * other * r->spaced;
    half sum[GROUPS][2] = {{{0}}}, opposite[GROUPS][2] = {{{0}}};
    for (int64_t k = 0; k < used; k++) {
        const int64_t lag = 2 * (block - 1 - r->used[k]);
        const double *at = filter + lag, *to = opposite_filter + lag;
        const half *f = r->spectra + place * row + 2 * GROUPS * r->used[k];
        __builtin_prefetch(f + row), __builtin_prefetch(f + row + 2); /* spectra of the next place */
        for (int g = 0; g < GROUPS; g++, f += 2) { /* the spectrum of real numbers is conjugate at the opposite place */
            const half re = f[0], im = f[1];
            half *u = sum[g], *v = opposite[g];
            u[0] += at[0] * re, u[1] += at[1] * re, v[0] += to[0] * re, v[1] += to[1] * re;
            u[0] -= at[1] * im, u[1] += at[0] * im, v[0] += to[1] * im, v[1] -= to[0] * im;
        }
    }
    for (int g = 0; g < GROUPS; g++) {
        half *z = r->work + 4 * FAR * g;
        z[2 * other] = opposite[g][0], z[2 * other + 1] = opposite[g][1];
        z[2 * place] = sum[g][0], z[2 * place + 1] = sum[g][1];
    }
}

/* Store a place of the spectrum of the forces of a block. */
INLINE void NAME(keep)(const Response *r, const half *z, int place, int64_t block, int g) {
    half *to = r->spectra + 2 * (GROUPS * (place * r->spaced + block) + g);
    to[0] = z[2 * place], to[1] = z[2 * place + 1];
}

/* Sums over the forces of earlier blocks, (GROUPS, FAR, 2), in `work`; `used` blocks have forces other than 0. */
APART TARGET void NAME(far_sums)(const Response *r, int64_t block, int64_t used) {
    if (used && r->used[used - 1] == block - 1)
        for (int g = 0; g < GROUPS; g++) {
            half *z = r->work;
            memset(z, 0, sizeof(half) * 4 * FAR);
            for (int i = 0; i < FAR; i++) z[2 * i] = r->force[GROUPS * i + g];
            NAME(transform_real)(z, r->turn);
            NAME(keep)(r, z, 0, block - 1, g);
            for (int n = 1; n < 2 * FAR; n *= 2)
                for (int i = n; i <= 3 * n - 1 - i; i++) NAME(keep)(r, z, i, block - 1, g);
        }
    NAME(far_places)(r, block, used, 0, 0);
    for (int n = 1; n < 2 * FAR; n *= 2)
        for (int i = n; i <= 3 * n - 1 - i; i++) NAME(far_places)(r, block, used, i, 3 * n - 1 - i);
    for (int g = 0; g < GROUPS; g++) NAME(restore)(r->work + 4 * FAR * g, r->turn);
}

/* Sums over the forces of this block before an even row, for this row and for the next. */
APART TARGET void NAME(near_sums)(const Response *r, int row, half near[GROUPS][2][2]) {
    memset(near, 0, sizeof(half) * GROUPS * 4);
    for (int odd = 0; odd < 2; odd++) { /* even and odd forces are summed separately, in registers */
        half sum[GROUPS][4] = {{{0}}};
        for (int past = odd; past < row; past += 2) {
            const double *at = r->response + 2 * (row - past - 1);
            const half *f = r->force + GROUPS * past;
            for (int i = 0; i < 4; i++)
                for (int g = 0; g < GROUPS; g++) sum[g][i] += at[i] * f[g];
        }
        for (int g = 0; g < GROUPS; g++)
            for (int i = 0; i < 4; i++) near[g][i / 2][i % 2] += sum[g][i];
    }
}

/* Mask of the cases whose indentation may leave the branch. */
INLINE mask NAME(turns)(const Cases *c, half a) {
    const Histories *m = &c->history;
    const half last = c->indentation;
    const mask falls = a < last, virgin = m->branch == (double)VIRGIN, unloading = m->branch == (double)UNLOADING;
    const mask back = (a >= m->peak) | (unloading & (a > last)) | (~unloading & falls);
    return (virgin & falls) | (~virgin & back);
}

/* History of a case after a step that ends at an indentation. */
INLINE History NAME(turned)(const Cases *c, int lane, double a) {
    const Histories *m = &c->history;
    const Point last = {c->indentation[lane], c->force[lane]};
    const History old = {m->branch[lane], m->f[lane], m->b[lane], m->w[lane],
                         m->p[lane], m->peak[lane], m->peak_force[lane], m->permanent[lane]};
    return accepted(c->law + lane, &old, &last, a);
}

/* Forces on the curves of the branches. */
INLINE void NAME(curves)(const Cases *cases, const half *a, half *force) {
    const half none = {0};
    mask on[GROUPS], other[GROUPS];
    for (int g = 0; g < GROUPS; g++) on[g] = a[g] > cases[g].history.b, force[g] = none;
    if (!NAME(any)(on)) return;
    half x[GROUPS];
    for (int g = 0; g < GROUPS; g++) {
        const Histories *m = &cases[g].history;
        const half p = m->p;
        x[g] = NAME(choose)(on[g], (a[g] - m->b) / m->w, none);
        const half root = ROOT(x[g]);
        force[g] = NAME(choose)(p == 1.5, x[g] * root, NAME(choose)(p == 2.0, x[g] * x[g], x[g] * x[g] * root));
        other[g] = on[g] & (p != 1.5) & (p != 2.0) & (p != 2.5);
    }
    if (NAME(any)(other))
        for (int g = 0; g < GROUPS; g++)
            for (int lane = 0; lane < WIDTH; lane++)
                if (other[g][lane]) force[g][lane] = pow(x[g][lane], cases[g].history.p[lane]);
    for (int g = 0; g < GROUPS; g++) force[g] = NAME(choose)(on[g], cases[g].history.f * force[g], none);
}

/* Move a mode of the projectiles step by step under forces on the tip. */
INLINE void NAME(move_mode)(const Sweep *x, int64_t mode, const half *applied, int steps, half motion[GROUPS][3]) {
    const int64_t n = x->modes;
    const double *T = x->T + mode, *h = x->h + mode;
    for (int step = 0; step < steps; step++)
        for (int g = 0; g < GROUPS; g++) {
            const half q = motion[g][0], v = motion[g][1], a = motion[g][2], push = applied[GROUPS * step + g];
            for (int row = 0; row < 3; row++) {
                const double *at = T + 3 * row * n;
                motion[g][row] = at[0] * q + at[n] * v + at[2 * n] * a + h[row * n] * push;
            }
        }
}

/* Sums over two of every four forces, for the motion after CHECKED steps. */
INLINE void NAME(reach_sums)(const double *reach, const half *applied, half total[GROUPS][3]) {
    half sum[2][GROUPS][3] = {{{{0}}}};
    for (int step = 0; step < CHECKED; step += 4, reach += 12, applied += 4 * GROUPS)
        for (int part = 0; part < 2; part++)
            for (int row = 0; row < 3; row++)
                for (int g = 0; g < GROUPS; g++)
                    sum[part][g][row] += reach[3 * part + row] * applied[GROUPS * part + g];
    for (int g = 0; g < GROUPS; g++)
        for (int row = 0; row < 3; row++) total[g][row] = sum[0][g][row] + sum[1][g][row];
}

/* Move a mode by CHECKED steps at once. */
INLINE void NAME(leap_mode)(const Response *r, int64_t mode, const half *applied, int pushed, half motion[GROUPS][3]) {
    const double *P = r->power + 9 * mode, *reach = r->reach + 3 * CHECKED * mode;
    half sum[2][GROUPS][3] = {{{{0}}}};
    if (pushed) {
        NAME(reach_sums)(reach, applied, sum[0]);
        NAME(reach_sums)(reach + 6, applied + 2 * GROUPS, sum[1]);
    }
    for (int g = 0; g < GROUPS; g++) {
        const half q = motion[g][0], v = motion[g][1], a = motion[g][2];
        for (int row = 0; row < 3; row++)
            motion[g][row] = (sum[0][g][row] + sum[1][g][row]) +
                             (P[3 * row] * q + P[3 * row + 1] * v + P[3 * row + 2] * a);
    }
}

/* Move all modes by a number of steps. */
APART TARGET void NAME(move_modes)(const Sweep *x, const Response *r, const half *applied, int steps) {
    int pushed = 0;
    for (int i = 0; i < GROUPS * steps && !pushed; i++) pushed = ANY(applied[i] != 0.0);
    for (int64_t mode = 0; mode < x->modes; mode++) {
        half(*motion)[3] = (half(*)[3])(r->motion + 3 * GROUPS * mode);
        if (steps == CHECKED)
            NAME(leap_mode)(r, mode, applied, pushed, motion);
        else
            NAME(move_mode)(x, mode, applied, steps, motion);
    }
}

/* Initialise cases before their impacts; cases beyond the last repeat it.  `gain` is the acceleration of the tip per
 * force. */
INLINE void NAME(begin)(const Sweep *x, double gain, int64_t first, Cases *c) {
    const half none = {0};
    half given[GIVEN];
    for (int lane = 0; lane < WIDTH; lane++) {
        c->at[lane] = first + lane < x->cases ? first + lane : x->cases - 1;
        for (int row = 0; row < GIVEN; row++) given[row][lane] = x->given[row * x->stride + c->at[lane]];
        c->law[lane] = (Law){given[GIVEN_K][lane], given[GIVEN_Q][lane], given[GIVEN_CRITICAL][lane],
                             given[GIVEN_SLOPE][lane], x->law};
    }
    c->history = (Histories){none, given[GIVEN_K], none, none + 1.0, none + 1.5, none, none, none};
    c->scale = given[GIVEN_FACTOR], c->gain = gain / c->scale;
    c->tip = none, c->velocity = -given[GIVEN_VELOCITY], c->acceleration = none;
    c->approach = c->indentation = c->force = c->push = c->w = c->dw = none;
    c->deepest = c->highest = c->sharpest = c->lost = c->unconverged = none;
    c->fastest = c->compliance = none;
    c->bent = c->bent_work = c->pushes = c->rigid = none;
    c->plate_work = c->contact_work = none;
}

/* Record a step that ends at a displacement of the plate, a force, an approach and an indentation. */
INLINE void NAME(record)(const Sweep *x, Cases *c, half w, half force, half approach, half indentation) {
    const half mean = 0.5 * (c->force + force), before = c->dw;
    c->contact_work += mean * (approach - c->approach);
    c->dw = w - c->w;
    c->plate_work += mean * c->dw;
    const half bend = NAME(size)(c->dw - before);
    c->pushes += c->force;
    c->rigid += x->rigid * c->pushes;
    const half bent = w - c->rigid, change = bent - c->bent;
    c->bent_work += mean * change;
    c->w = w, c->bent = bent, c->force = force, c->approach = approach, c->indentation = indentation;
    const half fast = NAME(size)(change), least = LEAST_WORK * c->initial;
    c->fastest = NAME(choose)(fast > c->fastest, fast, c->fastest);
    const half energy = NAME(choose)(c->bent_work > least, c->bent_work, least);
    const half compliance = bent * NAME(size)(bent) / (2.0 * energy);
    c->compliance = NAME(choose)(compliance > c->compliance, compliance, c->compliance);
    c->sharpest = NAME(choose)(bend > c->sharpest, bend, c->sharpest);
    c->deepest = NAME(choose)(indentation > c->deepest, indentation, c->deepest);
    c->highest = NAME(choose)(w > c->highest, w, c->highest);
}

/* Forces of the contact law at trial indentations, in the cases `where`. */
INLINE void NAME(trial)(const Cases *cases, const mask *where, const half *a, half *force) {
    mask turning[GROUPS];
    for (int g = 0; g < GROUPS; g++) turning[g] = where[g] & NAME(turns)(cases + g, a[g]);
    NAME(curves)(cases, a, force);
    if (!NAME(any)(turning)) return;
    for (int g = 0; g < GROUPS; g++)
        for (int lane = 0; lane < WIDTH; lane++) {
            if (!turning[g][lane]) continue;
            const History new = NAME(turned)(cases + g, lane, a[g][lane]);
            force[g][lane] = force_of(&new, a[g][lane]);
        }
}

/* Indentations and forces of the law in series with a spring, at approaches; see SeriesLaw in reduced_plate.py. */
APART TARGET void NAME(in_series)(double flexibility, const Cases *cases, const half *approach, half *a, half *force) {
    const half none = {0};
    half excess[GROUPS] = {{0}}, last[GROUPS], far[GROUPS], far_excess[GROUPS];
    mask all[GROUPS], open[GROUPS];
    for (int g = 0; g < GROUPS; g++) {
        all[g] = none == none;
        far[g] = approach[g] - flexibility * cases[g].force;
    }
    NAME(trial)(cases, all, far, force);
    for (int g = 0; g < GROUPS; g++) {
        far_excess[g] = far[g] + flexibility * force[g] - approach[g];
        const half end = cases[g].indentation, next = far[g] - far_excess[g];
        const half low = NAME(choose)(end < far[g], end, far[g]), high = NAME(choose)(end < far[g], far[g], end);
        a[g] = NAME(choose)(next < low, low, NAME(choose)(next > high, high, next));
    }
    for (int count = 0; count <= EVALUATIONS; count++) {
        NAME(trial)(cases, all, a, force);
        for (int g = 0; g < GROUPS; g++) {
            const half before = excess[g];
            excess[g] = a[g] + flexibility * force[g] - approach[g];
            if (count) {
                const mask crosses = excess[g] * before <= 0.0;
                const half weight = 1.0 - excess[g] / before;
                const half kept = far_excess[g] * NAME(choose)(weight > 0.0, weight, none + 0.5);
                far_excess[g] = NAME(choose)(open[g], NAME(choose)(crosses, before, kept), far_excess[g]);
                far[g] = NAME(choose)(open[g] & crosses, last[g], far[g]);
            }
            open[g] = ~(NAME(size)(excess[g]) <= SOLVED * NAME(size)(approach[g]));
        }
        if (count == EVALUATIONS || !NAME(any)(open)) return;
        for (int g = 0; g < GROUPS; g++) {
            last[g] = a[g];
            const half secant = a[g] - excess[g] * (a[g] - far[g]) / (excess[g] - far_excess[g]);
            a[g] = NAME(choose)(open[g], secant, a[g]);
        }
    }
}

/* The contact iteration and the step of the tip; see couple_step.  The contact is in series with a spring of a
 * flexibility, which is a part of the approach and of the plate's displacement. */
INLINE void NAME(couple)(const Sweep *x, double flexibility, Cases *cases, const half *w, const half *base) {
    const half none = {0};
    half drift[GROUPS], carried[GROUPS], trial[GROUPS], force[GROUPS], approach[GROUPS], a[GROUPS];
    mask iterating[GROUPS], turning[GROUPS];
    for (int g = 0; g < GROUPS; g++) {
        const Cases *c = cases + g;
        drift[g] = c->tip + x->dt * c->velocity + x->weight_before * c->acceleration;
        carried[g] = (1.0 - x->theta) * c->force;
        trial[g] = drift[g] + x->weight * c->acceleration;
        force[g] = c->force;
        iterating[g] = none == none;
    }
    for (int pass = 0; pass < PASSES && NAME(any)(iterating); pass++) {
        half tried[GROUPS];
        for (int g = 0; g < GROUPS; g++) approach[g] = -trial[g] - w[g];
        if (flexibility > 0.0)
            NAME(in_series)(flexibility, cases, approach, a, tried);
        else
            NAME(trial)(cases, iterating, approach, tried);
        for (int g = 0; g < GROUPS; g++) {
            force[g] = NAME(choose)(iterating[g], tried[g], force[g]);
            const half before = trial[g];
            trial[g] = drift[g] + x->weight * (base[g] + cases[g].gain * (carried[g] + x->theta * force[g]));
            iterating[g] &= ~(NAME(size)(trial[g] - before) < TOLERANCE * NAME(size)(trial[g]));
        }
    }
    for (int g = 0; g < GROUPS; g++) {
        Cases *c = cases + g;
        c->unconverged += NAME(choose)(iterating[g], none + 1.0, none);
        c->push = carried[g] + x->theta * force[g];
        const half now = base[g] + c->gain * c->push;
        c->tip = drift[g] + x->weight * now;
        c->velocity += x->dt / 2.0 * (c->acceleration + now);
        c->acceleration = now;
        a[g] = approach[g] = -c->tip - w[g];
    }
    if (flexibility > 0.0) {
        half unused[GROUPS];
        NAME(in_series)(flexibility, cases, approach, a, unused);
    }
    for (int g = 0; g < GROUPS; g++) turning[g] = NAME(turns)(cases + g, a[g]);
    if (NAME(any)(turning))
        for (int g = 0; g < GROUPS; g++)
            for (int lane = 0; lane < WIDTH; lane++) {
                if (!turning[g][lane]) continue;
                const History new = NAME(turned)(cases + g, lane, a[g][lane]);
                Histories *m = &cases[g].history;
                m->branch[lane] = new.branch, m->f[lane] = new.f, m->b[lane] = new.b, m->w[lane] = new.w;
                m->p[lane] = new.p, m->peak[lane] = new.peak, m->peak_force[lane] = new.peak_force;
                m->permanent[lane] = new.permanent;
            }
    for (int g = 0; g < GROUPS; g++) {
        Cases *c = cases + g;
        if (flexibility > 0.0)
            NAME(record)(x, c, w[g] + flexibility * force[g], force[g], approach[g], approach[g] - flexibility * force[g]);
        else
            NAME(record)(x, c, w[g], force[g], approach[g], approach[g]);
    }
}

/* Compare the energies of the cases with the initial energies; `plate` is the energy of the plate. */
INLINE void NAME(balance)(const Sweep *x, const half *motion, half plate, Cases *c) {
    half energy = {0};
    for (int64_t i = 0; i < x->modes; i++, motion += 3 * GROUPS)
        energy += motion[1] * motion[1] + x->stiffness[i] * motion[0] * motion[0];
    const half error = NAME(size)(0.5 * c->scale * energy + c->contact_work + plate - c->initial);
    c->lost = NAME(choose)(~(error <= c->lost), error, c->lost);
}

/* Store the results of the cases. */
INLINE void NAME(store_found)(const Sweep *x, const Cases *c) {
    const Histories *m = &c->history;
    for (int lane = 0; lane < WIDTH; lane++) {
        const double indentation = c->indentation[lane];
        const double peak = m->branch[lane] == VIRGIN && indentation > m->peak[lane] ? indentation : m->peak[lane];
        const double found[FOUND] = {
            [FOUND_DEEPEST] = c->deepest[lane],
            [FOUND_INDENTATION] = indentation,
            [FOUND_PERMANENT] = permanent(c->law + lane, peak),
            [FOUND_HIGHEST] = c->highest[lane],
            [FOUND_W] = c->w[lane],
            [FOUND_LARGEST_DDW] = c->sharpest[lane],
            [FOUND_LOST] = c->lost[lane],
            [FOUND_INITIAL] = c->initial[lane],
            [FOUND_UNCONVERGED] = c->unconverged[lane],
            [FOUND_LARGEST_DW] = c->fastest[lane],
            [FOUND_BENT_WORK] = c->bent_work[lane],
            [FOUND_COMPLIANCE] = c->compliance[lane],
            [FOUND_CONTACT_WORK] = c->contact_work[lane],
        };
        for (int row = 0; row < FOUND; row++) x->found[row * x->stride + c->at[lane]] = found[row];
    }
}

/* Compute the impacts of eight cases. */
TARGET void NAME(run_cases)(const Sweep *x, const Response *r, int64_t first) {
    Cases cases[GROUPS];
    half applied[GROUPS * CHECKED], near[GROUPS][2][2] = {{{{0}}}};
    memset(r->motion, 0, sizeof(half) * 3 * GROUPS * x->modes);
    for (int g = 0; g < GROUPS; g++) {
        Cases *c = cases + g;
        NAME(begin)(x, r->gain, first + WIDTH * g, c);
        half *rigid = r->motion + 3 * g + 1;
        *rigid = c->velocity / x->tip_shape[0];
        c->initial = 0.5 * c->scale * *rigid * *rigid;
    }
    int64_t used = 0;
    int fresh = 0; /* whether forces of this block are not all 0 */
    for (int64_t step = 0; step < x->steps; step++) {
        const int row = step % FAR;
        if (!row) {
            if (fresh) r->used[used++] = step / FAR - 1;
            NAME(far_sums)(r, step / FAR, used);
            fresh = 0;
        }
        if (row & 1)
            for (int g = 0; g < GROUPS; g++)
                for (int part = 0; part < 2; part++)
                    near[g][0][part] = near[g][1][part] + r->response[part] * r->force[GROUPS * (row - 1) + g];
        else
            NAME(near_sums)(r, fresh ? row : 0, near);
        half w[GROUPS], base[GROUPS];
        for (int g = 0; g < GROUPS; g++) {
            const half *far = r->work + 4 * FAR * g + 2 * row;
            w[g] = far[0] + near[g][0][0];
            const half pushed = far[1] + near[g][0][1];
            base[g] = pushed * r->unit / cases[g].scale;
        }
        NAME(couple)(x, 0.0, cases, w, base);
        for (int g = 0; g < GROUPS; g++) {
            const Cases *c = cases + g;
            r->force[GROUPS * row + g] = c->force;
            applied[GROUPS * (step % CHECKED) + g] = c->push / c->scale;
            if (ANY(c->force != 0.0)) fresh = 1;
            for (int lane = 0; lane < WIDTH; lane++) x->force[c->at[lane] * x->steps + step] = c->force[lane];
        }
        if ((step + 1) % CHECKED && step + 1 < x->steps) continue;
        NAME(move_modes)(x, r, applied, step % CHECKED + 1);
        for (int g = 0; g < GROUPS; g++) NAME(balance)(x, r->motion + 3 * g, cases[g].plate_work, cases + g);
    }
    for (int g = 0; g < GROUPS; g++) NAME(store_found)(x, cases + g);
}
