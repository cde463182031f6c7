/* Many impacts on one plate, four cases at a time; included once for each instruction set. */

INLINE half NAME(choose)(mask where, half a, half b) { return (half)((where & (mask)a) | (~where & (mask)b)); }
INLINE half NAME(size)(half x) { return (half)((mask)x & INT64_MAX); }
INLINE int NAME(any)(mask where) { return (where[0] | where[1] | where[2] | where[3]) != 0; }

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
            for (int64_t i = 0; i < 4 * FAR; i++) r->filter[(first + lane) * 4 * FAR + i] = z[i][lane];
    }
}

/* Sums over the forces of complete blocks, (FAR, 2), in `work`; `fresh` if those of the last are not all 0. */
INLINE void NAME(far_sums)(const Response *r, int64_t block, int fresh) {
    half *z = r->work;
    r->loaded[block - 1] = fresh;
    if (fresh) {
        half *spectrum = r->spectra + (block - 1) * 4 * FAR;
        for (int i = 0; i < FAR; i++) spectrum[2 * i] = r->force[i], spectrum[2 * i + 1] = (half){0};
        memset(spectrum + 2 * FAR, 0, sizeof(half) * 2 * FAR);
        NAME(transform)(spectrum, r->turn);
    }
    for (int first = 0; first < 4 * FAR; first += 8) {
        half sum[8] = {{0}};
        for (int64_t past = 0; past < block; past++) {
            if (!r->loaded[past]) continue;
            const double *g = r->filter + (block - 1 - past) * 4 * FAR + first;
            const half *f = r->spectra + past * 4 * FAR + first;
            for (int i = 0; i < 8; i += 2) {
                sum[i] += g[i] * f[i] - g[i + 1] * f[i + 1];
                sum[i + 1] += g[i] * f[i + 1] + g[i + 1] * f[i];
            }
        }
        memcpy(z + first, sum, sizeof sum);
    }
    NAME(restore)(z, r->turn);
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
        half q = {0}, v = {0}, a = {0}, q1 = {0}, v1 = {0}, a1 = {0};
        for (int step = 0; step < CHECKED; step += 2, g += 6) {
            const half f = applied[step], f1 = applied[step + 1];
            q += g[0] * f, v += g[1] * f, a += g[2] * f;
            q1 += g[3] * f1, v1 += g[4] * f1, a1 += g[5] * f1;
        }
        q += q1 + P[0] * y[0] + P[1] * y[1] + P[2] * y[2];
        v += v1 + P[3] * y[0] + P[4] * y[1] + P[5] * y[2];
        a += a1 + P[6] * y[0] + P[7] * y[1] + P[8] * y[2];
        y[0] = q, y[1] = v, y[2] = a;
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
        law[lane] = (Law){given[0][lane], given[1][lane], given[2][lane], given[3][lane]};
    const half scale = given[5], gain = r->gain / scale;
    half m[8] = {none, given[0], none, none + 1.0, none + 1.5, none, none, none};
    half tip = none, velocity = -given[4], acceleration = none, indentation = none, force = none, w = none;
    half deepest = none, highest = none, sharpest = none, lost = none, unconverged = none;
    half plate_work = none, contact_work = none, dw = none, applied[CHECKED];
    for (int64_t i = 0; i < 3 * x->modes; i++) r->motion[i] = none;
    r->motion[1] = velocity / x->tip_shape[0]; /* the rigid motion */
    const half initial = 0.5 * scale * r->motion[1] * r->motion[1];
    int fresh = 0; /* whether forces of the last block are not all 0 */
    for (int64_t step = 0; step < x->steps; step++) {
        const int row = step % FAR;
        if (!row) {
            if (step) NAME(far_sums)(r, step / FAR, fresh);
            else memset(r->work, 0, sizeof(half) * 2 * FAR);
            fresh = 0;
        }
        half sum[2][4] = {{none}};
        if (fresh) {
            const double *g = r->response + 2 * (row - 1);
            int past = 0;
            for (; past + 4 <= row; past += 4, g -= 8)
                for (int i = 0; i < 4; i++) {
                    sum[0][i] += g[-2 * i] * r->force[past + i];
                    sum[1][i] += g[1 - 2 * i] * r->force[past + i];
                }
            for (; past < row; past++, g -= 2)
                sum[0][0] += g[0] * r->force[past], sum[1][0] += g[1] * r->force[past];
        }
        const half moved = r->work[2 * row] + ((sum[0][0] + sum[0][1]) + (sum[0][2] + sum[0][3]));
        const half pushed = r->work[2 * row + 1] + ((sum[1][0] + sum[1][1]) + (sum[1][2] + sum[1][3]));
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
        const double found[FOUND] = {deepest[lane], indentation[lane], permanent(law + lane, peak), highest[lane],
                                     w[lane], sharpest[lane], lost[lane], initial[lane], unconverged[lane]};
        for (int row = 0; row < FOUND; row++) x->found[row * x->stride + at[lane]] = found[row];
    }
}
