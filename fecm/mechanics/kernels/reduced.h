/* Many impacts on a nonlinear plate in a few modes, eight cases at a time; included once for each instruction set.
 *
 * The arithmetic is the same as in ReducedMotion of reduced_plate.py.  Cases are lanes, as in sweep.h.  The
 * coordinates move by central differences.  The projectile moves in its modes, step by step.
 *
 * Membrane.  The energy is 1/2 sum stiffness q^2 + z' C s + 1/2 |B s|^2, with s_ij = z_i z_j of the pairs i <= j of
 * the amplitudes z of the bending, which the coordinates of the membrane follow in z.  B over C is one matrix G, whose
 * product with s gives B s and the forces C s on z.  The product of G' with (B s, z) gives the forces on the pairs.
 * Only the rows of C from the first one on that is not 0 are in G.
 *
 * Sums have a fixed order and no lane reads another lane, so that the result of a case does not depend on the other
 * cases, to the last bit.  A call runs in one thread and allocates nothing.
 */

/* y = A x; A is cut into tiles of rows. */
APART TARGET void NAME(multiply)(const double *A, int64_t rows, int64_t columns, const half *x, half *y) {
    for (int64_t row = 0; row < rows; row += TILE) {
        half sum[TILE][GROUPS] = {{{0}}};
        for (int64_t column = 0; column < columns; column++, A += TILE)
            for (int i = 0; i < TILE; i++)
                for (int g = 0; g < GROUPS; g++) sum[i][g] += A[i] * x[GROUPS * column + g];
        for (int i = 0; i < TILE; i++)
            for (int g = 0; g < GROUPS; g++) *y++ = sum[i][g];
    }
}

/* Internal forces f of the coordinates q. */
APART TARGET void NAME(internal)(const Reduced *p, const Reduction *r) {
    const int64_t bent = GROUPS * p->bending, n = bent + GROUPS * p->membrane;
    const int64_t m = p->shapes, pairs = m * (m + 1) / 2, seen = m + p->membrane, rows = p->rank + seen - p->coupled;
    half *s = r->s, *at = r->sums + GROUPS * p->rank;
    NAME(multiply)(p->part, m, p->bending, r->q, r->z);
    for (int64_t k = bent; k < n; k++) r->z[GROUPS * m + k - bent] = r->q[k];
    for (int64_t i = 0; i < m; i++)
        for (int64_t k = GROUPS * i; k < GROUPS * m; k++) *s++ = r->z[GROUPS * i + k % GROUPS] * r->z[k];
    NAME(multiply)(p->factor, rows, pairs, r->s, r->sums);
    memset(r->g, 0, sizeof(half) * GROUPS * p->coupled);
    for (int64_t k = GROUPS * p->coupled; k < GROUPS * seen; k++, at++) r->g[k] = *at, *at = r->z[k];
    NAME(multiply)(p->transposed, pairs, rows, r->sums, r->n);
    const half *force = r->n;
    for (int64_t i = 0; i < m; i++) {
        half sum[GROUPS] = {{0}}, z[GROUPS];
        for (int g = 0; g < GROUPS; g++) z[g] = r->z[GROUPS * i + g];
        for (int64_t j = i; j < m; j++)
            for (int g = 0; g < GROUPS; g++, force++) {
                sum[g] += *force * r->z[GROUPS * j + g];
                r->g[GROUPS * j + g] += *force * z[g];
            }
        for (int g = 0; g < GROUPS; g++) r->g[GROUPS * i + g] += sum[g];
    }
    NAME(multiply)(p->spread, p->bending, m, r->g, r->f);
    for (int64_t k = bent; k < n; k++) r->f[k] = r->g[GROUPS * m + k - bent];
    for (int64_t k = 0; k < n; k++) r->f[k] += p->stiffness[k / GROUPS] * r->q[k];
}

/* Increment of coordinate i in the next step, under a contact force. */
INLINE half NAME(increment)(const Reduced *p, const Reduction *r, int64_t i, int g, half force) {
    const int64_t k = GROUPS * i + g;
    return p->keep[i] * r->d[k] + p->share[i] * (p->deflection[i] * force - r->f[k]);
}

/* Move the coordinates by a step under the contact forces at its start.  Gives their displacement under the load,
 * and adds the energy that is lost by damping. */
APART TARGET void NAME(advance)(const Reduced *p, const Reduction *r, const Cases *cases, half *w, half *damped) {
    for (int g = 0; g < GROUPS; g++) {
        half moved = {0}, square = {0};
        for (int64_t i = 0; i < p->bending + p->membrane; i++) {
            const int64_t k = GROUPS * i + g;
            const half next = NAME(increment)(p, r, i, g, cases[g].force), v = p->rate[i] * (r->d[k] + next);
            square += v * v;
            r->d[k] = next, r->q[k] += next;
            moved += p->deflection[i] * r->q[k];
        }
        w[g] = moved, damped[g] += p->damping * square;
    }
    NAME(internal)(p, r);
}

/* Kinetic energy plus strain energy, plus the energy lost by damping.  The internal force f of the strain energy
 * U_2 + U_3 + U_4, of powers of q, does the work q f = 2 U_2 + 3 U_3 + 4 U_4. */
INLINE half NAME(plate_energy)(const Reduced *p, const Reduction *r, int g, half force, half damped) {
    half square = {0}, work = {0}, second = {0}, fourth = {0};
    for (int64_t i = 0; i < p->bending + p->membrane; i++) {
        const int64_t k = GROUPS * i + g;
        const half v = p->rate[i] * (r->d[k] + NAME(increment)(p, r, i, g, force));
        square += v * v;
        work += r->q[k] * r->f[k];
        second += 0.5 * p->stiffness[i] * r->q[k] * r->q[k];
    }
    for (int64_t i = 0; i < p->rank; i++) fourth += 0.5 * r->sums[GROUPS * i + g] * r->sums[GROUPS * i + g];
    return 0.5 * square + (work + second - fourth) / 3.0 + damped + 0.5 * p->damping * square;
}

/* Acceleration of the tip in the next step without a force. */
INLINE half NAME(free_tip)(const Sweep *x, const Reduction *r, int g) {
    half sum = {0};
    const int64_t n = x->modes;
    const double *T = x->T + 6 * n;
    for (int64_t i = 0; i < n; i++) {
        const half *at = r->projectile + 3 * (GROUPS * i + g);
        sum += x->tip_shape[i] * (T[i] * at[0] + T[n + i] * at[1] + T[2 * n + i] * at[2]);
    }
    return sum;
}

/* Store the coordinates at the times that lie in a step, from row `row` on.  Gives the next row. */
APART TARGET int64_t NAME(store_coordinates)(const Reduced *p, const Reduction *r, const Cases *cases, int64_t step, int64_t row) {
    const int64_t n = p->bending + p->membrane;
    for (; row < p->rows && p->step[row] == step; row++)
        for (int64_t k = 0; k < GROUPS * n; k++) {
            const half q = r->q[k] - p->back[row] * r->d[k];
            const Cases *c = cases + k % GROUPS;
            for (int lane = 0; lane < WIDTH; lane++)
                p->stored[(c->at[lane] * p->rows + row) * n + k / GROUPS] = q[lane];
        }
    return row;
}

/* Compute the impacts of eight cases. */
TARGET void NAME(run_reduced)(const Sweep *x, const Reduced *p, const Reduction *r, int64_t first) {
    Cases cases[GROUPS];
    half damped[GROUPS] = {{0}};
    double gain = 0.0;
    for (int64_t i = 0; i < x->modes; i++) gain += x->tip_shape[i] * x->h[2 * x->modes + i];
    memset(r->q, 0, sizeof(half) * 3 * GROUPS * (p->bending + p->membrane)); /* d and f follow q */
    memset(r->projectile, 0, sizeof(half) * 3 * GROUPS * x->modes);
    for (int g = 0; g < GROUPS; g++) {
        Cases *c = cases + g;
        NAME(begin)(x, gain, first + WIDTH * g, c);
        half *rigid = r->projectile + 3 * g + 1;
        *rigid = c->velocity / x->tip_shape[0];
        c->initial = 0.5 * c->scale * *rigid * *rigid;
    }
    for (int64_t step = 0, row = 0; step < x->steps; step++) {
        half w[GROUPS], base[GROUPS], applied[GROUPS];
        NAME(advance)(p, r, cases, w, damped);
        row = NAME(store_coordinates)(p, r, cases, step, row);
        for (int g = 0; g < GROUPS; g++) base[g] = NAME(free_tip)(x, r, g);
        NAME(couple)(x, p->flexibility, cases, w, base);
        for (int g = 0; g < GROUPS; g++) {
            const Cases *c = cases + g;
            applied[g] = c->push / c->scale;
            for (int lane = 0; lane < WIDTH; lane++) x->force[c->at[lane] * x->steps + step] = c->force[lane];
        }
        for (int64_t mode = 0; mode < x->modes; mode++)
            NAME(move_mode)(x, mode, applied, 1, (half(*)[3])(r->projectile + 3 * GROUPS * mode));
        if ((step + 1) % CHECKED && step + 1 < x->steps) continue;
        for (int g = 0; g < GROUPS; g++) {
            const half energy = NAME(plate_energy)(p, r, g, cases[g].force, damped[g]);
            NAME(balance)(x, r->projectile + 3 * g, energy, cases + g);
        }
    }
    for (int g = 0; g < GROUPS; g++) NAME(store_found)(x, cases + g);
}
