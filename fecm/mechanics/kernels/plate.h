/* K u of a plate; included once for each instruction set. */

INLINE half NAME(load)(const double *x) { return *(const half *)x; }
INLINE void NAME(store)(double *x, half value) { *(half *)x = value; }

/* y = A x, A (m, n), x and y a value in each lane; four rows at a time stay in registers. */
INLINE void NAME(product)(const double *A, int m, int n, const lanes *x, lanes *y) {
    int r = 0;
    for (; r + 4 <= m; r += 4, A += 4 * n) {
        half a0 = {0}, b0 = {0}, a1 = {0}, b1 = {0}, a2 = {0}, b2 = {0}, a3 = {0}, b3 = {0};
        for (int c = 0; c < n; c++) {
            const half a = x[c].a, b = x[c].b;
            a0 += A[c] * a, b0 += A[c] * b;
            a1 += A[n + c] * a, b1 += A[n + c] * b;
            a2 += A[2 * n + c] * a, b2 += A[2 * n + c] * b;
            a3 += A[3 * n + c] * a, b3 += A[3 * n + c] * b;
        }
        y[r] = (lanes){a0, b0}, y[r + 1] = (lanes){a1, b1};
        y[r + 2] = (lanes){a2, b2}, y[r + 3] = (lanes){a3, b3};
    }
    for (; r + 2 <= m; r += 2, A += 2 * n) {
        half a0 = {0}, b0 = {0}, a1 = {0}, b1 = {0};
        for (int c = 0; c < n; c++) {
            const half a = x[c].a, b = x[c].b;
            a0 += A[c] * a, b0 += A[c] * b;
            a1 += A[n + c] * a, b1 += A[n + c] * b;
        }
        y[r] = (lanes){a0, b0}, y[r + 1] = (lanes){a1, b1};
    }
    for (; r < m; r++, A += n) {
        half a = {0}, b = {0};
        for (int c = 0; c < n; c++) a += A[c] * x[c].a, b += A[c] * x[c].b;
        y[r] = (lanes){a, b};
    }
}

/* x (nd, nodes) of the nodes (nodes, 8) of eight elements. */
INLINE void NAME(gather)(int nd, int nodes, const int32_t *from, const double *u, lanes *x) {
    const int64_t entries = nd == 3 ? 4 : nd;
    for (int node = 0; node < nodes; node++, from += LANES)
        for (int side = 0; side < 2; side++) {
            const double *p0 = u + entries * from[4 * side], *p1 = u + entries * from[4 * side + 1];
            const double *p2 = u + entries * from[4 * side + 2], *p3 = u + entries * from[4 * side + 3];
            half *to = side ? &x[node].b : &x[node].a;
            const int next = 2 * nodes; /* halves from one dof to the next */
            const half r0 = NAME(load)(p0), r1 = NAME(load)(p1), r2 = NAME(load)(p2), r3 = NAME(load)(p3);
            const half t0 = __builtin_shufflevector(r0, r1, 0, 4, 2, 6);
            const half t1 = __builtin_shufflevector(r0, r1, 1, 5, 3, 7);
            const half t2 = __builtin_shufflevector(r2, r3, 0, 4, 2, 6);
            const half t3 = __builtin_shufflevector(r2, r3, 1, 5, 3, 7);
            to[0] = __builtin_shufflevector(t0, t2, 0, 1, 4, 5);
            to[next] = __builtin_shufflevector(t1, t3, 0, 1, 4, 5);
            to[2 * next] = __builtin_shufflevector(t0, t2, 2, 3, 6, 7);
            if (nd == 5) {
                to[3 * next] = __builtin_shufflevector(t1, t3, 2, 3, 6, 7);
                to[4 * next] = (half){p0[4], p1[4], p2[4], p3[4]};
            }
        }
}

/* Add y (nd, nodes) to the forces of the nodes (nodes, 8) of eight elements. */
INLINE void NAME(scatter)(int nd, int nodes, const int32_t *to, const lanes *y, double *f) {
    const int64_t entries = nd == 3 ? 4 : nd;
    for (int node = 0; node < nodes; node++, to += LANES)
        for (int side = 0; side < 2; side++) {
            const half *from = side ? &y[node].b : &y[node].a;
            const int next = 2 * nodes;
            const half none = {0};
            const half r0 = from[0], r1 = from[next], r2 = from[2 * next], r3 = nd == 5 ? from[3 * next] : none;
            const half t0 = __builtin_shufflevector(r0, r1, 0, 4, 2, 6);
            const half t1 = __builtin_shufflevector(r0, r1, 1, 5, 3, 7);
            const half t2 = __builtin_shufflevector(r2, r3, 0, 4, 2, 6);
            const half t3 = __builtin_shufflevector(r2, r3, 1, 5, 3, 7);
            const half rows[4] = {
                __builtin_shufflevector(t0, t2, 0, 1, 4, 5), __builtin_shufflevector(t1, t3, 0, 1, 4, 5),
                __builtin_shufflevector(t0, t2, 2, 3, 6, 7), __builtin_shufflevector(t1, t3, 2, 3, 6, 7)};
            for (int lane = 0; lane < 4; lane++) {
                double *p = f + entries * to[4 * side + lane];
                NAME(store)(p, NAME(load)(p) + rows[lane]);
                if (nd == 5) p[4] += from[4 * next][lane];
            }
        }
}

/* One matrix for all elements. */
INLINE void NAME(shared_matrix)(int nd, int nodes, const Group *g, const lanes *x, lanes *y) {
    const int n = nd * nodes, pairs = (int)g->pairs;
    if (!pairs) {
        NAME(product)(g->matrix, n, n, x, y);
        return;
    }
    /* Under half a turn w keeps its sign, the other dofs change it. */
    const int w = nd == 5 ? 2 : 0, centre = nodes > 2 * pairs;
    const int even = nd * pairs + (centre ? 1 : 0), odd = n - even;
    lanes parts[60], products[60];
    lanes *e = parts, *o = parts + even;
    for (int dof = 0; dof < nd; dof++) {
        const lanes *a = x + dof * nodes, *b = a + pairs;
        for (int i = 0; i < pairs; i++) {
            const lanes sum = {a[i].a + b[i].a, a[i].b + b[i].b}, rest = {a[i].a - b[i].a, a[i].b - b[i].b};
            *e++ = dof == w ? sum : rest;
            *o++ = dof == w ? rest : sum;
        }
        if (centre) *(dof == w ? e++ : o++) = a[2 * pairs];
    }
    NAME(product)(g->matrix, even, even, parts, products);
    NAME(product)(g->matrix + even * even, odd, odd, parts + even, products + even);
    e = products, o = products + even;
    for (int dof = 0; dof < nd; dof++) {
        lanes *a = y + dof * nodes, *b = a + pairs;
        for (int i = 0; i < pairs; i++, e++, o++) {
            a[i] = (lanes){e->a + o->a, e->b + o->b};
            b[i] = dof == w ? (lanes){e->a - o->a, e->b - o->b} : (lanes){o->a - e->a, o->b - e->b};
        }
        if (centre) a[2 * pairs] = dof == w ? *e++ : *o++;
    }
}

/* Strains at the points of quadrature from values and slopes in xi and eta, stresses, and back. */
INLINE void NAME(no_matrix)(int nd, int nodes, const Plate *p, const Group *g, const double *data, const lanes *x, lanes *y) {
    const int nb = (int)g->bending, ns = (int)g->shear, nt = (int)g->tying;
    const int values = nt ? 2 * nt : ns, slopes = nt ? 2 * nt : 2 * ns, first = nd == 5 ? 2 : 0;
    lanes at_w[32], at_r[2][48], at_u[2][32], e[2][16], part[12];
    const lanes *w = x + first * nodes;
    const double *C = p->stiffness, *S = p->shear;
    NAME(product)(g->deflection, slopes, nodes, w, at_w);
    for (int i = 0; i < 2; i++) {
        NAME(product)(g->rotations, 2 * nb + values, nodes, w + (1 + i) * nodes, at_r[i]);
        if (nd == 5) NAME(product)(g->rotations, 2 * nb, nodes, x + i * nodes, at_u[i]);
    }
    /* x_xi and the like at the tying points, behind the points' data. */
    const double *slope = data + (nb + ns) * 5 * LANES;
    const half zero = {0};
    for (int side = 0; side < 2; side++) { /* four lanes at a time */
#define H(value) (*((half *)&(value) + side))
#define G(k) NAME(load)(data + (point * 5 + (k)) * LANES + 4 * side)
        for (int point = 0; point < nb; point++) {
            const half xx = G(0), xe = G(1), yx = G(2), ye = G(3), jxw = G(4);
            lanes *const a = at_r[0] + point, *const b = at_r[1] + point;
            half strain[6], stress[6];
            strain[3] = xx * H(a[0]) + xe * H(a[nb]);
            strain[4] = yx * H(b[0]) + ye * H(b[nb]);
            strain[5] = yx * H(a[0]) + ye * H(a[nb]) + xx * H(b[0]) + xe * H(b[nb]);
            int from = 3;
            if (nd == 5) {
                const lanes *const c = at_u[0] + point, *const d = at_u[1] + point;
                from = 0;
                strain[0] = xx * H(c[0]) + xe * H(c[nb]);
                strain[1] = yx * H(d[0]) + ye * H(d[nb]);
                strain[2] = yx * H(c[0]) + ye * H(c[nb]) + xx * H(d[0]) + xe * H(d[nb]);
            }
            for (int i = from; i < 6; i++) {
                half sum = zero;
                for (int j = from; j < 6; j++) sum += C[6 * i + j] * strain[j];
                stress[i] = jxw * sum;
            }
            H(a[0]) = xx * stress[3] + yx * stress[5], H(a[nb]) = xe * stress[3] + ye * stress[5];
            H(b[0]) = xx * stress[5] + yx * stress[4], H(b[nb]) = xe * stress[5] + ye * stress[4];
            if (nd == 5) {
                lanes *const c = at_u[0] + point, *const d = at_u[1] + point;
                H(c[0]) = xx * stress[0] + yx * stress[2], H(c[nb]) = xe * stress[0] + ye * stress[2];
                H(d[0]) = xx * stress[2] + yx * stress[1], H(d[nb]) = xe * stress[2] + ye * stress[1];
            }
        }
        if (!nt)
            for (int k = 0; k < ns; k++) {
                const int point = nb + k;
                const half xx = G(0), xe = G(1), yx = G(2), ye = G(3), jxw = G(4);
                lanes *const a = at_r[0] + 2 * nb + k, *const b = at_r[1] + 2 * nb + k;
                const half sx = xx * H(at_w[k]) + xe * H(at_w[ns + k]) - H(*a);
                const half sy = yx * H(at_w[k]) + ye * H(at_w[ns + k]) - H(*b);
                const half qx = jxw * (S[0] * sx + S[1] * sy), qy = jxw * (S[2] * sx + S[3] * sy);
                H(at_w[k]) = xx * qx + yx * qy, H(at_w[ns + k]) = xe * qx + ye * qy;
                H(*a) = -qx, H(*b) = -qy;
            }
    }
    if (nt) { /* assumed shear strains: covariant, from the tying points */
        for (int axis = 0; axis < 2; axis++) {
            for (int k = 0; k < nt; k++)
                for (int side = 0; side < 2; side++) {
                    const int t = axis * nt + k, place = 2 * nb + t;
                    const half sx = NAME(load)(slope + 2 * t * LANES + 4 * side);
                    const half sy = NAME(load)(slope + (2 * t + 1) * LANES + 4 * side);
                    H(part[k]) = H(at_w[t]) - sx * H(at_r[0][place]) - sy * H(at_r[1][place]);
                }
            NAME(product)(g->tied + axis * ns * nt, ns, nt, part, e[axis]);
        }
        for (int side = 0; side < 2; side++)
            for (int k = 0; k < ns; k++) {
                const int point = nb + k;
                const half xx = G(0), xe = G(1), yx = G(2), ye = G(3), jxw = G(4);
                const half sx = xx * H(e[0][k]) + xe * H(e[1][k]), sy = yx * H(e[0][k]) + ye * H(e[1][k]);
                const half qx = jxw * (S[0] * sx + S[1] * sy), qy = jxw * (S[2] * sx + S[3] * sy);
                H(e[0][k]) = xx * qx + yx * qy, H(e[1][k]) = xe * qx + ye * qy;
            }
        for (int axis = 0; axis < 2; axis++) {
            NAME(product)(g->tied_t + axis * ns * nt, nt, ns, e[axis], part);
            for (int k = 0; k < nt; k++)
                for (int side = 0; side < 2; side++) {
                    const int t = axis * nt + k, place = 2 * nb + t;
                    const half sx = NAME(load)(slope + 2 * t * LANES + 4 * side);
                    const half sy = NAME(load)(slope + (2 * t + 1) * LANES + 4 * side);
                    H(at_w[t]) = H(part[k]);
                    H(at_r[0][place]) = -sx * H(part[k]), H(at_r[1][place]) = -sy * H(part[k]);
                }
        }
    }
#undef G
#undef H
    lanes *const yw = y + first * nodes;
    NAME(product)(g->deflection_t, nodes, slopes, at_w, yw);
    for (int i = 0; i < 2; i++) {
        NAME(product)(g->rotations_t, nodes, 2 * nb + values, at_r[i], yw + (1 + i) * nodes);
        if (nd == 5) NAME(product)(g->in_plane_t, nodes, 2 * nb, at_u[i], y + i * nodes);
    }
}

/* Scale the internal forces of entries, add to the sums, and take the next step if asked to. */
INLINE void NAME(update)(const Plate *p, int64_t first, int64_t count, double *force, int next, half *sums) {
    const double *mass = p->mass + first, *scale = p->scale + first;
    double *u = p->u + first, *d = p->d + first, *s = p->s + first;
    const double keep = 1.0 - p->damping, share = 1.0 / (1.0 + p->damping);
    const half zero = {0};
    half inertia = sums[0], power = sums[1], strain = sums[2], internal = sums[3];
    int64_t i = 0;
    for (; i + 4 <= count; i += 4) {
        const half f = NAME(load)(force + i), old = NAME(load)(d + i), v = NAME(load)(u + i);
        const half scaled = f * NAME(load)(scale + i);
        NAME(store)(force + i, zero);
        inertia += NAME(load)(mass + i) * old * old;
        power += old * f, strain += v * f, internal += f * scaled;
        if (next) {
            const half now = (keep * old - scaled) * share;
            NAME(store)(d + i, now);
            NAME(store)(u + i, v + now);
        } else
            NAME(store)(s + i, scaled);
    }
    for (; i < count; i++) {
        const double f = force[i], old = d[i], v = u[i], scaled = f * scale[i];
        force[i] = 0.0;
        inertia[0] += mass[i] * old * old;
        power[0] += old * f, strain[0] += v * f, internal[0] += f * scaled;
        if (next) {
            d[i] = (keep * old - scaled) * share;
            u[i] = v + d[i];
        } else
            s[i] = scaled;
    }
    sums[0] = inertia, sums[1] = power, sums[2] = strain, sums[3] = internal;
}

/* Forces of a chunk; its own nodes are updated as soon as their forces are complete. */
INLINE void NAME(chunk)(int nd, const Plate *p, const Chunk *chunk, int next, half *sums) {
    lanes x[60], y[60];
    int64_t done = 0;
    for (int64_t number = 0; number < chunk->blocks; number++) {
        const Block *b = chunk->block + number;
        const Group *g = b->group;
        const int nodes = (int)g->nodes;
        NAME(gather)(nd, nodes, b->from, p->u, x);
        if (g->kind == SHARED)
            nodes == 9 ? NAME(shared_matrix)(nd, 9, g, x, y) : NAME(shared_matrix)(nd, nodes, g, x, y);
        else
            nodes == 9 ? NAME(no_matrix)(nd, 9, p, g, b->data, x, y) : NAME(no_matrix)(nd, nodes, p, g, b->data, x, y);
        NAME(scatter)(nd, nodes, b->to, y, chunk->force);
        if (b->done > done) {
            NAME(update)(p, p->nd * (chunk->first + done), p->nd * (b->done - done), chunk->force + p->nd * done, next, sums);
            done = b->done;
        }
    }
}

TARGET void NAME(run_chunk)(const Plate *p, int64_t number, int next, half *sums) {
    memset(sums, 0, 4 * sizeof *sums);
    if (p->nd == 4)
        NAME(chunk)(3, p, p->chunk + number, next, sums);
    else
        NAME(chunk)(5, p, p->chunk + number, next, sums);
}

/* Add up what the chunks share, update it, and add up the sums of all, (chunks, 4). */
TARGET Sums NAME(finish)(const Plate *p, int next, half *sums) {
    const int64_t nd = p->nd;
    half total[4];
    memset(total, 0, sizeof total);
    for (int64_t number = 0; number < p->chunks; number++) {
        const Chunk *chunk = p->chunk + number;
        double *force = chunk->force + nd * chunk->nodes;
        for (int64_t node = 0; node < chunk->shared; node++)
            for (int64_t dof = 0; dof < nd; dof++) {
                p->shared[nd * (chunk->shares[node] - p->own) + dof] +=
                    chunk->signs[nd * node + dof] * force[nd * node + dof];
                force[nd * node + dof] = 0.0;
            }
        for (int i = 0; i < 4; i++) total[i] += sums[4 * number + i];
    }
    NAME(update)(p, nd * p->own, nd * (p->nodes - p->own), p->shared, next, total);
    double added[4];
    for (int i = 0; i < 4; i++) added[i] = (total[i][0] + total[i][1]) + (total[i][2] + total[i][3]);
    return (Sums){added[0], added[1], added[2], added[3]};
}
