/* Many impacts on one plate, four cases at a time; included once for each instruction set.
 *
 * Plate and projectile are linear.  The displacement w of the plate and the acceleration of the tip
 * are sums over the earlier contact forces of a case with `response`, the answers to a unit force:
 * w_n = sum over m < n of g_(n-m) F_m.  The force of a step follows from w by the contact iteration.
 *
 * Layout.  Each of four lanes is a case; those beyond the last case repeat it.  Response and spectra
 * interleave plate and tip, (.., 2), so that both sums are one complex transform: the plate is the
 * real part, the tip the imaginary one, divided by `unit` to be of the same size.
 *
 * Sums.  Steps are cut into blocks of FAR.  Forces of earlier blocks act by Fourier transforms of
 * 2 FAR numbers, once per block (far_sums); blocks without a force are left out.  Forces of this block
 * act one by one (near_sums).  Both run over the past in a fixed order, and no lane reads another, so
 * that a case has the same bytes in any company.
 *
 * Every CHECKED steps the modes of the projectile are moved on, by a power of the step's matrix and
 * the forces since, and the energies are compared: the largest error is that of a case.
 *
 * Threads.  None: a call computes its cases alone, and several processes share a sweep.
 */

INLINE half NAME(choose)(mask where, half a, half b) { return (half)((where & (mask)a) | (~where & (mask)b)); }
INLINE half NAME(size)(half x) { return (half)((mask)x & INT64_MAX); }
INLINE int NAME(any)(mask where) { return ANY(where); }

/* Fourier transform of 2 FAR numbers (re, im); frequencies are in bit-reversed order. */
INLINE void NAME(transform)(half *z, const double *turn) {
    for (int width = FAR, step = 1; width; width /= 2, step *= 2)
        for (int first = 0; first < 2 * FAR; first += 2 * width)
            for (int i = 0; i < width; i++) {
                half *u = z + 2 * (first + i), *v = u + 2 * width;
                const double c = turn[2 * i * step], s = turn[2 * i * step + 1];
                const half re = u[0] - v[0], im = u[1] - v[1];
                u[0] += v[0], u[1] += v[1];
                v[0] = c * re + s * im, v[1] = c * im - s * re;
            }
}

/* The inverse of `transform`, times 2 FAR. */
INLINE void NAME(restore)(half *z, const double *turn) {
    for (int width = 1, step = FAR; width <= FAR; width *= 2, step /= 2)
        for (int first = 0; first < 2 * FAR; first += 2 * width)
            for (int i = 0; i < width; i++) {
                half *u = z + 2 * (first + i), *v = u + 2 * width;
                const double c = turn[2 * i * step], s = turn[2 * i * step + 1];
                const half re = c * v[0] - s * v[1], im = c * v[1] + s * v[0];
                v[0] = u[0] - re, v[1] = u[1] - im;
                u[0] += re, u[1] += im;
            }
}

/* Spectra (blocks - 1, 2 FAR, 2) of the responses that a block of forces meets 1, 2, ... blocks later. */
TARGET void NAME(filters)(const Sweep *x, const Response *r) {
    const int64_t count = (x->steps - 1) / FAR;
    for (int64_t first = 0; first < count; first += CASES) {
        half *z = r->work;
        memset(z, 0, sizeof(half) * 4 * FAR);
        for (int64_t lane = 0; lane < CASES; lane++)
            for (int64_t i = 1 - FAR; i < FAR; i++) {
                const int64_t n = (first + lane + 1) * FAR + i - 1;
                if (n >= x->steps) break;
                for (int part = 0; part < 2; part++)
                    z[2 * (i < 0 ? i + 2 * FAR : i) + part][lane] = r->response[2 * n + part] / (2 * FAR);
            }
        NAME(transform)(z, r->turn);
        for (int64_t lane = 0; lane < CASES && first + lane < count; lane++)
            for (int64_t i = 0; i < 4 * FAR; i++) r->filter[(first + lane) * SPACED + i] = z[i][lane];
    }
}

/* sum += g f, and at the opposite frequency opposite += h f*; f is the spectrum of real numbers. */
INLINE void NAME(add_product)(const double *g, const double *h, const half *f, half *sum, half *opposite) {
    const half re = f[0], im = f[1];
    sum[0] += g[0] * re, sum[1] += g[1] * re, opposite[0] += h[0] * re, opposite[1] += h[1] * re;
    sum[0] -= g[1] * im, sum[1] += g[0] * im, opposite[0] += h[1] * im, opposite[1] -= h[0] * im;
}

/* Spectrum of those sums at a place and those after it, and at the opposite place and those before it. */
INLINE void NAME(far_places)(const Response *r, int64_t block, int64_t used, int first, int last, const int places) {
    half sum[2][2] = {{{0}}}, opposite[2][2] = {{{0}}};
    for (int64_t k = 0; k < used; k++) {
        const double *g = r->filter + (block - 1 - r->used[k]) * SPACED;
        const half *f = r->spectra + r->used[k] * SPACED;
        for (int i = 0; i < places; i++)
            NAME(add_product)(g + 2 * (first + i), g + 2 * (last - i), f + 2 * (first + i), sum[i], opposite[i]);
    }
    for (int i = 0; i < places; i++) {
        half *at = r->work + 2 * (first + i), *to = r->work + 2 * (last - i);
        at[0] = sum[i][0], at[1] = sum[i][1];
        to[0] = opposite[i][0], to[1] = opposite[i][1];
    }
}

/* Sums over the forces of earlier blocks, (FAR, 2), in `work`; `used` of them have forces other than 0. */
INLINE void NAME(far_sums)(const Response *r, int64_t block, int64_t used) {
    half *z = r->work;
    if (used && r->used[used - 1] == block - 1) {
        half *spectrum = r->spectra + (block - 1) * SPACED;
        memset(z, 0, sizeof(half) * 4 * FAR);
        for (int i = 0; i < FAR; i++) z[2 * i] = r->force[i];
        NAME(transform)(z, r->turn);
        /* Places i and 3 n - 1 - i, n the largest power of two in i, have opposite frequencies. */
        memcpy(spectrum, z, sizeof(half) * 4);
        for (int n = 2; n < 2 * FAR; n *= 2) memcpy(spectrum + 2 * n, z + 2 * n, sizeof(half) * n);
    }
    for (int place = 0; place < 2; place++) { /* their own opposites */
        half sum[2] = {{0}}, opposite[2] = {{0}};
        for (int64_t k = 0; k < used; k++) {
            const double *g = r->filter + (block - 1 - r->used[k]) * SPACED + 2 * place;
            NAME(add_product)(g, g, r->spectra + r->used[k] * SPACED + 2 * place, sum, opposite);
        }
        z[2 * place] = sum[0], z[2 * place + 1] = sum[1];
    }
    NAME(far_places)(r, block, used, 2, 3, 1);
    for (int n = 4; n < 2 * FAR; n *= 2)
        for (int first = n, last = 2 * n - 1; first < last; first += 2, last -= 2)
            NAME(far_places)(r, block, used, first, last, 2);
    NAME(restore)(z, r->turn);
}

/* Sums over the forces of this block before an even row, for it and for the next one. */
INLINE void NAME(near_sums)(const Response *r, int row, half near[2][2]) {
    const double *g = r->response + 2 * row;
    half sum[2][4]; /* of even and odd forces */
    for (int i = 0; i < 8; i++) sum[i / 4][i % 4] = (half){0};
    for (int past = 0; past < row; past += 2)
        for (int odd = 0; odd < 2; odd++, g -= 2) {
            const half f = r->force[past + odd];
            sum[odd][0] += g[-2] * f, sum[odd][1] += g[-1] * f, sum[odd][2] += g[0] * f, sum[odd][3] += g[1] * f;
        }
    for (int i = 0; i < 4; i++) near[i / 2][i % 2] = sum[0][i] + sum[1][i];
}

/* Cases whose indentation may leave the branch. */
INLINE mask NAME(turns)(const half *m, half last, half a) {
    const mask falls = a < last, virgin = m[0] == (double)VIRGIN, unloading = m[0] == (double)UNLOADING;
    const mask back = (a >= m[5]) | (unloading & (a > last)) | (~unloading & falls);
    return (virgin & falls) | (~virgin & back);
}

INLINE History NAME(pick)(const half *m, int lane) {
    return (History){m[0][lane], m[1][lane], m[2][lane], m[3][lane],
                     m[4][lane], m[5][lane], m[6][lane], m[7][lane]};
}

/* Force on the curves of the branches. */
INLINE half NAME(curve)(const half *m, half a) {
    const half none = {0}, p = m[4];
    const mask on = a > m[2];
    if (!NAME(any)(on)) return none;
    const half x = NAME(choose)(on, (a - m[2]) / m[3], none), root = ROOT(x);
    half value = NAME(choose)(p == 1.5, x * root, NAME(choose)(p == 2.0, x * x, x * x * root));
    const mask other = on & (p != 1.5) & (p != 2.0) & (p != 2.5);
    if (NAME(any)(other))
        for (int lane = 0; lane < CASES; lane++)
            if (other[lane]) value[lane] = pow(x[lane], p[lane]);
    return NAME(choose)(on, m[1] * value, none);
}

/* Motion of the modes of four projectiles after some steps under forces on the tip. */
INLINE void NAME(move_modes)(const Sweep *x, const Response *r, const half *applied, int steps) {
    const int64_t n = x->modes;
    int pushed = 0;
    for (int step = 0; step < steps && !pushed; step++) pushed = NAME(any)(applied[step] != 0.0);
    for (int64_t i = 0; i < n; i++) {
        half *y = r->motion + 3 * i;
        if (steps < CHECKED) {
            for (int step = 0; step < steps; step++) {
                const half q = y[0], v = y[1], a = y[2];
                for (int row = 0; row < 3; row++) {
                    const double *T = x->T + 3 * row * n + i;
                    y[row] = T[0] * q + T[n] * v + T[2 * n] * a + x->h[row * n + i] * applied[step];
                }
            }
            continue;
        }
        const double *P = r->power + 9 * i, *g = r->reach + 3 * CHECKED * i;
        half sum[4][3] = {{{0}}};
        for (int step = 0; step < CHECKED && pushed; step += 4, g += 12)
            for (int part = 0; part < 4; part++)
                for (int row = 0; row < 3; row++) sum[part][row] += g[3 * part + row] * applied[step + part];
        const half q = y[0], v = y[1], a = y[2];
        for (int row = 0; row < 3; row++)
            y[row] = ((sum[0][row] + sum[1][row]) + (sum[2][row] + sum[3][row])) +
                     (P[3 * row] * q + P[3 * row + 1] * v + P[3 * row + 2] * a);
    }
}

/* The impacts of four cases; lanes beyond the last repeat it. */
TARGET void NAME(run_cases)(const Sweep *x, const Response *r, int64_t first) {
    const half none = {0};
    int64_t at[CASES];
    half given[GIVEN];
    for (int lane = 0; lane < CASES; lane++) {
        at[lane] = first + lane < x->cases ? first + lane : x->cases - 1;
        for (int row = 0; row < GIVEN; row++) given[row][lane] = x->given[row * x->stride + at[lane]];
    }
    Law law[CASES];
    for (int lane = 0; lane < CASES; lane++)
        law[lane] = (Law){given[GIVEN_K][lane], given[GIVEN_Q][lane], given[GIVEN_CRITICAL][lane], given[GIVEN_SLOPE][lane], x->law};
    const half scale = given[GIVEN_FACTOR], gain = r->gain / scale;
    half m[8] = {none, given[GIVEN_K], none, none + 1.0, none + 1.5, none, none, none};
    half tip = none, velocity = -given[GIVEN_VELOCITY], acceleration = none, indentation = none, force = none, w = none;
    half deepest = none, highest = none, sharpest = none, lost = none, unconverged = none;
    half plate_work = none, contact_work = none, dw = none, applied[CHECKED], near[2][2] = {{none}};
    for (int64_t i = 0; i < 3 * x->modes; i++) r->motion[i] = none;
    r->motion[1] = velocity / x->tip_shape[0]; /* the rigid motion */
    const half initial = 0.5 * scale * r->motion[1] * r->motion[1];
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
            for (int part = 0; part < 2; part++) near[0][part] = near[1][part] + r->response[part] * r->force[row - 1];
        else
            NAME(near_sums)(r, fresh ? row : 0, near);
        const half moved = r->work[2 * row] + near[0][0], pushed = r->work[2 * row + 1] + near[0][1];
        const half base = pushed * r->unit / scale;
        /* The contact iteration; see couple_step. */
        const half drift = tip + x->dt * velocity + x->weight_before * acceleration;
        const half carried = (1.0 - x->theta) * force, last_force = force, last = indentation;
        half trial = drift + x->weight * acceleration;
        mask iterating = none == none;
        for (int pass = 0; pass < PASSES && NAME(any)(iterating); pass++) {
            const half a = -trial - moved;
            half tried = NAME(curve)(m, a);
            const mask turning = iterating & NAME(turns)(m, last, a);
            if (NAME(any)(turning))
                for (int lane = 0; lane < CASES; lane++) {
                    if (!turning[lane]) continue;
                    const History old = NAME(pick)(m, lane);
                    const Point point = {last[lane], last_force[lane]};
                    const History new = accepted(law + lane, &old, &point, a[lane]);
                    tried[lane] = force_of(&new, a[lane]);
                }
            force = NAME(choose)(iterating, tried, force);
            const half before = trial;
            trial = drift + x->weight * (base + gain * (carried + x->theta * force));
            iterating &= ~(NAME(size)(trial - before) < TOLERANCE * NAME(size)(trial));
        }
        unconverged += NAME(choose)(iterating, none + 1.0, none);
        const half push = carried + x->theta * force, now = base + gain * push;
        tip = drift + x->weight * now;
        velocity += x->dt / 2.0 * (acceleration + now);
        acceleration = now;
        indentation = -tip - moved;
        const mask turning = NAME(turns)(m, last, indentation);
        if (NAME(any)(turning))
            for (int lane = 0; lane < CASES; lane++) {
                if (!turning[lane]) continue;
                const History old = NAME(pick)(m, lane);
                const Point point = {last[lane], last_force[lane]};
                const History new = accepted(law + lane, &old, &point, indentation[lane]);
                m[0][lane] = new.branch, m[1][lane] = new.f, m[2][lane] = new.b, m[3][lane] = new.w;
                m[4][lane] = new.p, m[5][lane] = new.peak, m[6][lane] = new.peak_force;
                m[7][lane] = new.permanent;
            }
        /* Records. */
        r->force[row] = force;
        applied[step % CHECKED] = push / scale;
        if (NAME(any)(force != 0.0)) fresh = 1;
        for (int lane = 0; lane < CASES; lane++) x->force[at[lane] * x->steps + step] = force[lane];
        const half mean = 0.5 * (last_force + force), before = dw;
        contact_work += mean * (indentation - last);
        dw = moved - w, w = moved;
        plate_work += mean * dw;
        const half bend = NAME(size)(dw - before);
        sharpest = NAME(choose)(bend > sharpest, bend, sharpest);
        deepest = NAME(choose)(indentation > deepest, indentation, deepest);
        highest = NAME(choose)(w > highest, w, highest);
        if ((step + 1) % CHECKED && step + 1 < x->steps) continue;
        NAME(move_modes)(x, r, applied, step % CHECKED + 1);
        half energy = none;
        for (int64_t i = 0; i < x->modes; i++) {
            const half q = r->motion[3 * i], v = r->motion[3 * i + 1];
            energy += v * v + x->stiffness[i] * q * q;
        }
        const half error = NAME(size)(0.5 * scale * energy + contact_work + plate_work - initial);
        lost = NAME(choose)(~(error <= lost), error, lost);
    }
    for (int lane = 0; lane < CASES; lane++) {
        const double peak = m[0][lane] == VIRGIN && indentation[lane] > m[5][lane] ? indentation[lane] : m[5][lane];
        const double found[FOUND] = {
            [FOUND_DEEPEST] = deepest[lane],
            [FOUND_INDENTATION] = indentation[lane],
            [FOUND_PERMANENT] = permanent(law + lane, peak),
            [FOUND_HIGHEST] = highest[lane],
            [FOUND_W] = w[lane],
            [FOUND_LARGEST_DDW] = sharpest[lane],
            [FOUND_LOST] = lost[lane],
            [FOUND_INITIAL] = initial[lane],
            [FOUND_UNCONVERGED] = unconverged[lane],
        };
        for (int row = 0; row < FOUND; row++) x->found[row * x->stride + at[lane]] = found[row];
    }
}
