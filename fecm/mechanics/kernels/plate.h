/* K u of a plate, and strains; included once for each instruction set.
 *
 ** Layout.  Eight elements of a group are computed at once: `lanes` has a value for each.  A block takes
 * the entries of its nodes from the vector u of its chunk, (nodes, nd) or (nd, nodes) of lanes, computes
 * y = K x in one of four ways, and adds y to the chunk's vector of forces:
 *
 **   ONE_MATRIX     product with the single matrix of congruent elements
 *   TWO_MATRICES   products with one matrix for motions even under a half turn and one for odd motions: half
 *                  the work
 *   FACTORIZED     quadrature of 9-node elements, with sums along xi and then along eta; with `tying` the shear
 *                  strains are assumed, see assumed_shear.h
 *   TABULATED      quadrature with tables of shape functions, for all other elements
 *
 * For a nonlinear plate K contains only w, theta_x and theta_y, and membrane.h adds the rest.
 *
 * If the eight places of a node are consecutive, they are loaded as two times four numbers.  Otherwise `lane`
 * has the eight places.  A lane without an element uses a spare place of the chunk.
 *
 * A chunk takes its copies of shared nodes from the last part of u.  Its blocks add forces, in their order.  The
 * chunk stores the forces on copies in `force`, and updates the entries of its own nodes at once, while they are
 * in the cache.  `finish` adds the stored forces, chunk by chunk, and updates the shared nodes.
 *
 * Sums.  In matrix products a register sums over the columns in ascending order.  `update` sums each energy over
 * all dofs in two registers of four lanes, for even and odd fours of nodes.  A chunk returns their sum,
 * (4 energies, 4 lanes).  The fifth sum is the work of the blocks of a nonlinear plate, and of supports with
 * gaps.  Only the layout fixes
 * the order of all sums.
 *
 * Threads.  run_chunk writes the entries of its chunk, its `force`, its `sums` and the buffer of its thread.  It
 * reads shared nodes, which only `finish` writes.
 */

INLINE half NAME(load)(const double *x) { return *(const half *)x; }
INLINE void NAME(store)(double *x, half value) { *(half *)x = value; }

/* y = A x for `rows` rows of A (rows, n); x and y have a value in each lane, and the sums stay in registers. */
INLINE void NAME(rows)(int rows, const double *A, int n, const lanes *x, lanes *y) {
    half a[5] = {{0}}, b[5] = {{0}};
    for (int c = 0; c < n; c++) {
        const half left = x[c].a, right = x[c].b;
#pragma GCC unroll 5
        for (int r = 0; r < rows; r++) a[r] += A[n * r + c] * left, b[r] += A[n * r + c] * right;
    }
#pragma GCC unroll 5
    for (int r = 0; r < rows; r++) y[r] = (lanes){a[r], b[r]};
}

/* y = A x with A (m, n), at most five rows at a time. */
TARGET void NAME(product)(const double *A, int m, int n, const lanes *x, lanes *y) {
    for (int r = 0; r < m;) {
        const int left = m - r, times = (left + 4) / 5, rows = (left + times - 1) / times;
        switch (rows) {
        case 1: NAME(rows)(1, A + n * r, n, x, y + r); break;
        case 2: NAME(rows)(2, A + n * r, n, x, y + r); break;
        case 3: NAME(rows)(3, A + n * r, n, x, y + r); break;
        case 4: NAME(rows)(4, A + n * r, n, x, y + r); break;
        default: NAME(rows)(5, A + n * r, n, x, y + r);
        }
        r += rows;
    }
}

/* Take the entries of eight nodes from a chunk, (nd, nodes); `give` adds y (nd,).  See Block for `at`. */
INLINE void NAME(take)(int nd, const Plate *p, const Chunk *c, int32_t at, const double *u, lanes *x, int step) {
    if (at >= 0)
        for (int dof = 0; dof < nd; dof++, u += c->nodes) x[dof * step] = (lanes){NAME(load)(u + at), NAME(load)(u + at + 4)};
    else {
        const int32_t *i = p->lane + LANES * (int64_t)~at;
        for (int dof = 0; dof < nd; dof++, u += c->nodes)
            x[dof * step] = (lanes){{u[i[0]], u[i[1]], u[i[2]], u[i[3]]}, {u[i[4]], u[i[5]], u[i[6]], u[i[7]]}};
    }
}

INLINE void NAME(give)(int nd, const Plate *p, const Chunk *c, int32_t at, const lanes *y, int step, double *f) {
    if (at >= 0)
        for (int dof = 0; dof < nd; dof++, f += c->nodes) {
            NAME(store)(f + at, NAME(load)(f + at) + y[dof * step].a);
            NAME(store)(f + at + 4, NAME(load)(f + at + 4) + y[dof * step].b);
        }
    else {
        const int32_t *i = p->lane + LANES * (int64_t)~at;
        for (int dof = 0; dof < nd; dof++, f += c->nodes)
            for (int lane = 0; lane < 4; lane++) f[i[lane]] += y[dof * step].a[lane];
        f -= nd * c->nodes;
        for (int dof = 0; dof < nd; dof++, f += c->nodes)
            for (int lane = 0; lane < 4; lane++) f[i[4 + lane]] += y[dof * step].b[lane];
    }
}

/* Elements with one matrix. */
INLINE void NAME(one_matrix)(int nd, int nodes, const Plate *p, const Chunk *c, const Block *b, const double *u, double *f) {
    lanes x[60] ALIGNED, y[60] ALIGNED;
    for (int node = 0; node < nodes; node++) NAME(take)(nd, p, c, b->place[node], u, x + node, nodes);
    NAME(product)(b->group->matrix, nd * nodes, nd * nodes, x, y);
    for (int node = 0; node < nodes; node++) NAME(give)(nd, p, c, b->place[node], y + node, nodes, f);
}

/* Elements with one matrix for even motions and one for odd motions.  Under a half turn w keeps its sign, and the
 * other dofs change sign.  Each motion has its dofs in order, (pairs,) or (pairs + 1,) with the centre. */
INLINE void NAME(two_matrices)(int nd, int pairs, int centre, const Plate *p, const Chunk *c, const Block *b, const double *u, double *f) {
    const int w = nd == 5 ? 2 : 0, even = nd * pairs + centre, odd = nd * (pairs + centre) - centre;
    const double *matrix = b->group->matrix;
    lanes x[60] ALIGNED, y[60] ALIGNED, one[5] ALIGNED, other[5] ALIGNED;
    for (int node = 0; node < pairs + centre; node++) {
        const int pair = node < pairs;
        NAME(take)(nd, p, c, b->place[pair ? node : 2 * pairs], u, one, 1);
        if (pair) NAME(take)(nd, p, c, b->place[pairs + node], u, other, 1);
        for (int dof = 0, e = node, o = even + node; dof < nd; dof++) {
            lanes *sum = x + (dof == w ? e : o), *rest = x + (dof == w ? o : e);
            *sum = one[dof];
            if (pair) {
                *sum = (lanes){one[dof].a + other[dof].a, one[dof].b + other[dof].b};
                *rest = (lanes){one[dof].a - other[dof].a, one[dof].b - other[dof].b};
            }
            e += pairs + (dof == w ? centre : 0), o += pairs + (dof == w ? 0 : centre);
        }
    }
    NAME(product)(matrix, even, even, x, y);
    NAME(product)(matrix + even * even, odd, odd, x + even, y + even);
    for (int node = 0; node < pairs + centre; node++) {
        const int pair = node < pairs;
        for (int dof = 0, e = node, o = even + node; dof < nd; dof++) {
            const lanes sum = y[dof == w ? e : o];
            one[dof] = sum;
            if (pair) {
                const lanes rest = y[dof == w ? o : e];
                one[dof] = (lanes){sum.a + rest.a, sum.b + rest.b};
                other[dof] = (lanes){sum.a - rest.a, sum.b - rest.b};
            }
            e += pairs + (dof == w ? centre : 0), o += pairs + (dof == w ? 0 : centre);
        }
        NAME(give)(nd, p, c, b->place[pair ? node : 2 * pairs], one, 1, f);
        if (pair) NAME(give)(nd, p, c, b->place[pairs + node], other, 1, f);
    }
}

/* Quadrature: strains at the points from values and slopes in xi and eta, stresses, and back to forces.  A
 * curved plate uses the values of w at the points of bending for w/R. */
INLINE void NAME(tabulated)(int nd, int nodes, const Plate *p, const Chunk *c, const Block *b, const double *u, double *f) {
    const Group *g = b->group;
    const double *data = b->data;
    lanes x[60] ALIGNED, y[60] ALIGNED;
    for (int node = 0; node < nodes; node++) NAME(take)(nd, p, c, b->place[node], u, x + node, nodes);
    const int nb = (int)g->bending, ns = (int)g->shear, nt = (int)g->tying;
    const int values = nt ? 2 * nt : ns, slopes = nt ? 2 * nt : 2 * ns, first = nd == 5 ? 2 : 0;
    const int sloped = slopes + (p->preload ? 2 * nb : 0), valued = sloped + (p->curvature ? nb : 0);
    lanes at_w[80], at_r[2][48], at_u[2][32], e[2][16], part[12];
    const lanes *w = x + first * nodes;
    const double *C = g->stiffness, *S = g->transverse;
    NAME(product)(g->deflection, valued, nodes, w, at_w);
    for (int i = 0; i < 2; i++) {
        NAME(product)(g->rotations, 2 * nb + values, nodes, w + (1 + i) * nodes, at_r[i]);
        if (nd == 5) NAME(product)(g->rotations, 2 * nb, nodes, x + i * nodes, at_u[i]);
    }
    /* Slopes of x and y at the tying points follow the data of the points. */
    const double *slope = data + (nb + ns) * 5 * LANES;
    const half zero = {0};
    for (int side = 0; side < 2; side++) { /* four lanes at a time */
#define G(k) NAME(load)(data + (point * 5 + (k)) * LANES + 4 * side)
        for (int point = 0; point < nb; point++) {
            const half xx = G(0), xe = G(1), yx = G(2), ye = G(3), jxw = G(4);
            lanes *const a = at_r[0] + point, *const b = at_r[1] + point;
            half strain[6], stress[6];
            strain[3] = xx * HALF(a[0]) + xe * HALF(a[nb]);
            strain[4] = yx * HALF(b[0]) + ye * HALF(b[nb]);
            strain[5] = yx * HALF(a[0]) + ye * HALF(a[nb]) + xx * HALF(b[0]) + xe * HALF(b[nb]);
            int from = 3;
            if (nd == 5) {
                const lanes *const q = at_u[0] + point, *const d = at_u[1] + point;
                from = 0;
                strain[0] = xx * HALF(q[0]) + xe * HALF(q[nb]);
                strain[1] = yx * HALF(d[0]) + ye * HALF(d[nb]);
                strain[2] = yx * HALF(q[0]) + ye * HALF(q[nb]) + xx * HALF(d[0]) + xe * HALF(d[nb]);
                if (p->curvature)
                    for (int i = 0; i < 3; i++) strain[i] += p->curvature[i] * HALF(at_w[sloped + point]);
            }
            for (int i = from; i < 6; i++) {
                half sum = zero;
                for (int j = from; j < 6; j++) sum += C[6 * i + j] * strain[j];
                stress[i] = jxw * sum;
            }
            HALF(a[0]) = xx * stress[3] + yx * stress[5], HALF(a[nb]) = xe * stress[3] + ye * stress[5];
            HALF(b[0]) = xx * stress[5] + yx * stress[4], HALF(b[nb]) = xe * stress[5] + ye * stress[4];
            if (nd == 5) {
                lanes *const q = at_u[0] + point, *const d = at_u[1] + point;
                HALF(q[0]) = xx * stress[0] + yx * stress[2], HALF(q[nb]) = xe * stress[0] + ye * stress[2];
                HALF(d[0]) = xx * stress[2] + yx * stress[1], HALF(d[nb]) = xe * stress[2] + ye * stress[1];
                if (p->curvature) {
                    half sum = zero;
                    for (int i = 0; i < 3; i++) sum += p->curvature[i] * stress[i];
                    HALF(at_w[sloped + point]) = sum;
                }
            }
        }
        if (!nt)
            for (int k = 0; k < ns; k++) {
                const int point = nb + k;
                const half xx = G(0), xe = G(1), yx = G(2), ye = G(3), jxw = G(4);
                lanes *const a = at_r[0] + 2 * nb + k, *const b = at_r[1] + 2 * nb + k;
                const half sx = xx * HALF(at_w[k]) + xe * HALF(at_w[ns + k]) - HALF(*a);
                const half sy = yx * HALF(at_w[k]) + ye * HALF(at_w[ns + k]) - HALF(*b);
                const half qx = jxw * (S[0] * sx + S[1] * sy), qy = jxw * (S[2] * sx + S[3] * sy);
                HALF(at_w[k]) = xx * qx + yx * qy, HALF(at_w[ns + k]) = xe * qx + ye * qy;
                HALF(*a) = -qx, HALF(*b) = -qy;
            }
    }
    if (nt) { /* assumed shear strains: covariant, from the tying points */
        for (int axis = 0; axis < 2; axis++) {
            for (int k = 0; k < nt; k++)
                for (int side = 0; side < 2; side++) {
                    const int t = axis * nt + k, place = 2 * nb + t;
                    const half sx = NAME(load)(slope + 2 * t * LANES + 4 * side);
                    const half sy = NAME(load)(slope + (2 * t + 1) * LANES + 4 * side);
                    HALF(part[k]) = HALF(at_w[t]) - sx * HALF(at_r[0][place]) - sy * HALF(at_r[1][place]);
                }
            NAME(product)(g->tied + axis * ns * nt, ns, nt, part, e[axis]);
        }
        for (int side = 0; side < 2; side++)
            for (int k = 0; k < ns; k++) {
                const int point = nb + k;
                const half xx = G(0), xe = G(1), yx = G(2), ye = G(3), jxw = G(4);
                const half sx = xx * HALF(e[0][k]) + xe * HALF(e[1][k]), sy = yx * HALF(e[0][k]) + ye * HALF(e[1][k]);
                const half qx = jxw * (S[0] * sx + S[1] * sy), qy = jxw * (S[2] * sx + S[3] * sy);
                HALF(e[0][k]) = xx * qx + yx * qy, HALF(e[1][k]) = xe * qx + ye * qy;
            }
        for (int axis = 0; axis < 2; axis++) {
            NAME(product)(g->tied_t + axis * ns * nt, nt, ns, e[axis], part);
            for (int k = 0; k < nt; k++)
                for (int side = 0; side < 2; side++) {
                    const int t = axis * nt + k, place = 2 * nb + t;
                    const half sx = NAME(load)(slope + 2 * t * LANES + 4 * side);
                    const half sy = NAME(load)(slope + (2 * t + 1) * LANES + 4 * side);
                    HALF(at_w[t]) = HALF(part[k]);
                    HALF(at_r[0][place]) = -sx * HALF(part[k]), HALF(at_r[1][place]) = -sy * HALF(part[k]);
                }
        }
    }
    if (p->preload) /* the initial membrane force on the slopes */
        for (int side = 0; side < 2; side++)
            for (int point = 0; point < nb; point++) {
                const half xx = G(0), xe = G(1), yx = G(2), ye = G(3), jxw = G(4);
                lanes *const a = at_w + slopes + point, *const b = a + nb;
                const half wx = xx * HALF(*a) + xe * HALF(*b), wy = yx * HALF(*a) + ye * HALF(*b);
                const half nx = jxw * (p->preload[0] * wx + p->preload[2] * wy);
                const half ny = jxw * (p->preload[2] * wx + p->preload[1] * wy);
                HALF(*a) = xx * nx + yx * ny, HALF(*b) = xe * nx + ye * ny;
            }
#undef G
    lanes *const yw = y + first * nodes;
    NAME(product)(g->deflection_t, nodes, valued, at_w, yw);
    for (int i = 0; i < 2; i++) {
        NAME(product)(g->rotations_t, nodes, 2 * nb + values, at_r[i], yw + (1 + i) * nodes);
        if (nd == 5) NAME(product)(g->in_plane_t, nodes, 2 * nb, at_u[i], y + i * nodes);
    }
    for (int node = 0; node < nodes; node++) NAME(give)(nd, p, c, b->place[node], y + node, nodes, f);
}

/* Biquadratic elements with the points of a tensor product, by sum factorization.
 *
 ** A quadratic with the values a, b, c at -1, 0, 1 has the coefficients c0 = b, c1 = c - a, c2 = a - 2 b + c.
 * Its value is c0 + c1 x/2 + c2 x^2/2, and twice its slope is c1 + 2 c2 x.  Points are ascending and symmetric,
 * so that even and odd parts give the values at x and -x at once.  Four elements are computed at a time. */
INLINE void NAME(values)(int n, const double *x, half c0, half c1, half c2, half *v, int step) {
    for (int k = 0; k < n / 2; k++) {
        const double at = x[n - 1 - k];
        const half even = c0 + 0.5 * at * at * c2, odd = 0.5 * at * c1;
        v[k * step] = even - odd, v[(n - 1 - k) * step] = even + odd;
    }
    if (n % 2) v[n / 2 * step] = c0;
}

INLINE void NAME(slopes)(int n, const double *x, half c1, half c2, half *v, int step) {
    for (int k = 0; k < n / 2; k++) {
        const half odd = 2.0 * x[n - 1 - k] * c2;
        v[k * step] = c1 - odd, v[(n - 1 - k) * step] = c1 + odd;
    }
    if (n % 2) v[n / 2 * step] = c1;
}

/* Their transposes: sums over the points, added to coefficients. */
INLINE void NAME(sum_values)(int n, const double *x, const half *v, int step, half *c0, half *c1, half *c2) {
    for (int k = 0; k < n / 2; k++) {
        const double at = x[n - 1 - k];
        const half even = v[(n - 1 - k) * step] + v[k * step], odd = v[(n - 1 - k) * step] - v[k * step];
        *c0 += even, *c1 += 0.5 * at * odd, *c2 += 0.5 * at * at * even;
    }
    if (n % 2) *c0 += v[n / 2 * step];
}

INLINE void NAME(sum_slopes)(int n, const double *x, const half *v, int step, half *c1, half *c2) {
    for (int k = 0; k < n / 2; k++) {
        *c1 += v[(n - 1 - k) * step] + v[k * step];
        *c2 += 2.0 * x[n - 1 - k] * (v[(n - 1 - k) * step] - v[k * step]);
    }
    if (n % 2) *c1 += v[n / 2 * step];
}

/* Coefficients (eta, xi) of nodal values (eta, xi), in place; and the transpose. */
INLINE void NAME(coefficients)(half *f) {
    for (int pass = 0; pass < 2; pass++)
        for (int line = 0, step = pass ? 3 : 1; line < 3; line++) {
            half *v = f + line * (pass ? 1 : 3);
            const half a = v[0], b = v[step], c = v[2 * step];
            v[0] = b, v[step] = c - a, v[2 * step] = (a + c) - 2.0 * b;
        }
}

INLINE void NAME(nodal)(half *f) {
    for (int pass = 0; pass < 2; pass++)
        for (int line = 0, step = pass ? 3 : 1; line < 3; line++) {
            half *v = f + line * (pass ? 1 : 3);
            const half c0 = v[0], c1 = v[step], c2 = v[2 * step];
            v[0] = c2 - c1, v[step] = c0 - 2.0 * c2, v[2 * step] = c2 + c1;
        }
}

#include "assumed_shear.h"

/* Forces on the coefficients of the dofs from strains at n x n points.  Forces of membrane and bending strains
 * are stored, forces of transverse shear strains are added; if both have the same points, their sum is stored.
 * If `tied`, `assumed` is twice the covariant shear strains at the points, (2, xi, eta), and is replaced by the
 * forces on them.
 *
 * The coefficients of x and y follow the coefficients of the dofs.  `weight` are the weights of the points,
 * `factor` is the factor of the element.  With twice the slopes J of x and y, their determinant d and twice the
 * slopes g of a field, strains are adj(J) g/d and the area of a point is its weight times d/4. */
INLINE void NAME(points)(int nd, int tied, int n, int bends, int shears, const Plate *p, const Group *g, const double *x,
                         const double *weight, half factor, half (*c)[9], half (*assumed)[3][3], half (*force)[9]) {
    const int w = nd - 3, fields = nd + 2, free = shears && !tied;
    const double *C = g->stiffness, *S = g->transverse;
    const int transposed = !tied && p->transposed;
    half V[7][3][4] ALIGNED, D[7][3][4] ALIGNED; /* values and slopes along xi */
#define SLOPES(i) ((i) >= nd || ((i) == w ? free : bends))
#define VALUES(i) ((i) > w && (i) < nd && free)
    for (int i = 0; i < fields; i++)
        for (int b = 0; b < 3; b++) {
            const half *f = c[i] + 3 * b;
            if (SLOPES(i)) NAME(slopes)(n, x, f[1], f[2], D[i][b], 1);
            if (VALUES(i) || (SLOPES(i) && b)) NAME(values)(n, x, f[0], f[1], f[2], V[i][b], 1);
        }
    for (int k = 0; k < n; k++) {
        half along[7][4] ALIGNED, across[7][4] ALIGNED, angle[2][4] ALIGNED;
        for (int i = 0; i < fields; i++) {
            if (SLOPES(i)) {
                NAME(values)(n, x, D[i][0][k], D[i][1][k], D[i][2][k], along[i], 1);
                NAME(slopes)(n, x, V[i][1][k], V[i][2][k], across[i], 1);
            }
            if (VALUES(i)) NAME(values)(n, x, V[i][0][k], V[i][1][k], V[i][2][k], angle[i - w - 1], 1);
        }
        const half *const of_xe = transposed ? across[nd] : along[nd + 1];
        const half *const of_yx = transposed ? along[nd + 1] : across[nd];
        for (int l = 0; l < n; l++) {
            const half xx = across[nd + 1][l], ye = along[nd][l], xe = -of_xe[l], yx = -of_yx[l];
            const half det = xx * ye - xe * yx, area = factor * weight[n * k + l] / det;
            if (bends) {
                half strain[6], stress[6];
                for (int i = w ? 0 : 1; i < nd; i += i ? 2 : 3) { /* u and v, theta_x and theta_y */
                    half *e = strain + (i ? 3 : 0);
                    const half a = along[i][l], b = across[i][l], d = along[i + 1][l], g = across[i + 1][l];
                    e[0] = area * (xx * a + xe * b), e[1] = area * (yx * d + ye * g);
                    e[2] = area * (yx * a + ye * b + (xx * d + xe * g));
                }
                for (int i = w ? 0 : 3; i < 6; i++) {
                    stress[i] = C[6 * i + 3] * strain[3] + C[6 * i + 4] * strain[4] + C[6 * i + 5] * strain[5];
                    if (w) stress[i] += C[6 * i] * strain[0] + C[6 * i + 1] * strain[1] + C[6 * i + 2] * strain[2];
                }
                for (int i = w ? 0 : 1; i < nd; i += i ? 2 : 3) {
                    const half *q = stress + (i ? 3 : 0);
                    along[i][l] = xx * q[0] + yx * q[2], across[i][l] = xe * q[0] + ye * q[2];
                    along[i + 1][l] = xx * q[2] + yx * q[1], across[i + 1][l] = xe * q[2] + ye * q[1];
                }
            }
            if (shears && tied) {
                half *const one = &assumed[0][k][l], *const other = &assumed[1][k][l];
                const half sx = area * (xx * *one + xe * *other), sy = area * (yx * *one + ye * *other);
                const half qx = S[0] * sx + S[1] * sy, qy = S[2] * sx + S[3] * sy;
                *one = xx * qx + yx * qy, *other = xe * qx + ye * qy;
            } else if (shears) {
                const half sx = area * (xx * along[w][l] + xe * across[w][l] - det * angle[0][l]);
                const half sy = area * (yx * along[w][l] + ye * across[w][l] - det * angle[1][l]);
                const half qx = S[0] * sx + S[1] * sy, qy = S[2] * sx + S[3] * sy;
                along[w][l] = xx * qx + yx * qy, across[w][l] = xe * qx + ye * qy;
                angle[0][l] = -det * qx, angle[1][l] = -det * qy;
            }
        }
        for (int i = 0; i < nd; i++) {
            half d[3] = {{0}}, v[3] = {{0}};
            if (SLOPES(i)) {
                NAME(sum_values)(n, x, along[i], 1, d, d + 1, d + 2);
                NAME(sum_slopes)(n, x, across[i], 1, v + 1, v + 2);
            }
            if (VALUES(i)) NAME(sum_values)(n, x, angle[i - w - 1], 1, v, v + 1, v + 2);
            for (int b = 0; b < 3; b++) D[i][b][k] = d[b], V[i][b][k] = v[b];
        }
    }
    for (int i = 0; i < nd; i++)
        for (int b = 0; b < 3; b++) {
            half sum[3] = {{0}};
            if (SLOPES(i)) NAME(sum_slopes)(n, x, D[i][b], 1, sum + 1, sum + 2);
            if (VALUES(i) || (SLOPES(i) && b)) NAME(sum_values)(n, x, V[i][b], 1, sum, sum + 1, sum + 2);
            for (int a = 0; a < 3; a++)
                if (bends)
                    force[i][3 * b + a] = sum[a];
                else
                    force[i][3 * b + a] += sum[a];
        }
#undef SLOPES
#undef VALUES
}

INLINE void NAME(factorized)(int nd, int tied, const Plate *p, const Chunk *chunk, const Block *b, const double *u, double *f) {
    const Group *g = b->group;
    const int nb = (int)g->bending, ns = (int)g->shear;
    const double *xb = g->rotations, *wb = g->rotations_t, *xs = g->deflection, *ws = g->deflection_t;
    lanes x[5][9] ALIGNED, y[5][9] ALIGNED;
    for (int node = 0; node < 9; node++) NAME(take)(nd, p, chunk, b->place[node], u, x[0] + node, 9);
    for (int side = 0; side < 2; side++) {
        half c[7][9] ALIGNED, force[5][9] ALIGNED;
        const half factor = NAME(load)(b->data + 4 * side);
        for (int dof = 0; dof < nd; dof++) {
            for (int node = 0; node < 9; node++) c[dof][node] = HALF(x[dof][node]);
            NAME(coefficients)(c[dof]);
        }
        c[nd][0] = c[nd + 1][0] = factor; /* has no effect on slopes */
        for (int i = 1; i < 9; i++)
            for (int axis = 0; axis < 2; axis++) c[nd + axis][i] = NAME(load)(b->data + LANES * (8 * axis + i) + 4 * side);
        half assumed[2][3][3] ALIGNED, mapping[2][2][2][3] ALIGNED;
        if (tied)
            for (int axis = 0; axis < 2; axis++) NAME(assume)(axis, c + nd - 3, mapping[axis], assumed[axis]);
        if (nb == 3 && ns == 3) /* the usual numbers of points, for which loops are unrolled */
            NAME(points)(nd, tied, 3, 1, 1, p, g, tied ? ACROSS : xb, wb, factor, c, assumed, force);
        else {
            NAME(points)(nd, tied, nb, 1, 0, p, g, xb, wb, factor, c, assumed, force);
            NAME(points)(nd, tied, tied ? 3 : ns, 0, 1, p, g, xs, ws, factor, c, assumed, force);
        }
        if (tied)
            for (int axis = 0; axis < 2; axis++) NAME(sum_assumed)(axis, assumed[axis], mapping[axis], force + nd - 3);
        for (int dof = 0; dof < nd; dof++) {
            NAME(nodal)(force[dof]);
            for (int node = 0; node < 9; node++) HALF(y[dof][node]) = force[dof][node];
        }
    }
    for (int node = 0; node < 9; node++) NAME(give)(nd, p, chunk, b->place[node], y[0] + node, 9, f);
}

/* Elements with assumed shear strains, whose inverse Jacobian is never transposed. */
TARGET void NAME(tied)(int nd, const Plate *p, const Chunk *chunk, const Block *b, const double *u, double *f) {
    if (nd == 3)
        NAME(factorized)(3, 1, p, chunk, b, u, f);
    else
        NAME(factorized)(5, 1, p, chunk, b, u, f);
}

#include "membrane.h"

/* Scale the internal forces of a chunk's nodes and add to the sums; take the next step if `next` is set. */
INLINE void NAME(update)(int nd, const Plate *p, const Chunk *c, double *force, int next, half *sums) {
    const int64_t n = c->nodes;
    const double keep = 1.0 - p->damping, share = 1.0 / (1.0 + p->damping);
    const double *const mass = p->mass + p->planes * c->first, *const inverse = p->inverse + p->planes * c->first;
    double *const u = p->u + nd * c->first, *const d = p->d + nd * c->first, *const s = p->s + nd * c->first;
    const half zero = {0};
    for (int64_t i = 0; i < c->supports; i++) {
        const Support *k = c->support + i;
        if (!k->side) {
            force[k->at] += k->stiffness * u[k->at];
            continue;
        }
        const double depth = k->side * u[k->at] - k->gap;
        if (depth > 0.0) {
            force[k->at] += k->side * k->stiffness * depth;
            sums[4][0] += k->stiffness * k->gap * depth;
        }
    }
    for (int64_t i = 0; i < c->fixed; i++) force[c->at_rest[i]] = 0.0;
    if (!p->rate) {
        memcpy(s, force, sizeof(double) * nd * n);
        memset(force, 0, sizeof(double) * nd * n);
        return;
    }
    half inertia[2] = {sums[0]}, power[2] = {sums[1]}, strain[2] = {sums[2]}, internal[2] = {sums[3]};
    for (int dof = 0; dof < nd; dof++) {
        const double ratio = p->ratio[dof], rate = p->rate[dof];
        const int64_t before = dof * n, of_mass = p->planes == 1 ? 0 : before;
        for (int64_t i = 0; i < n; i += LANES)
#pragma GCC unroll 2
            for (int side = 0; side < 2; side++) {
                const int64_t node = i + 4 * side, at = before + node;
                const half f = NAME(load)(force + at), old = NAME(load)(d + at), v = NAME(load)(u + at);
                const half scaled = f * (rate * NAME(load)(inverse + of_mass + node));
                NAME(store)(force + at, zero);
                inertia[side] += ratio * NAME(load)(mass + of_mass + node) * old * old;
                power[side] += old * f, strain[side] += v * f, internal[side] += f * scaled;
                if (next) {
                    const half now = (keep * old - scaled) * share;
                    NAME(store)(d + at, now);
                    NAME(store)(u + at, v + now);
                } else
                    NAME(store)(s + at, scaled);
            }
    }
    sums[0] = inertia[0] + inertia[1], sums[1] = power[0] + power[1];
    sums[2] = strain[0] + strain[1], sums[3] = internal[0] + internal[1];
}

/* Compute the forces of a chunk, and update the chunk's own nodes. */
INLINE void NAME(chunk)(int nd, int nonlinear, const Plate *p, const Chunk *c, int next, double *force, half *sums) {
    const Chunk *common = p->chunk + p->chunks;
    const int last = nonlinear ? 3 : nd;
    double *u = p->u + nd * c->first;
    const double *of_all = p->u + nd * common->first;
    for (int64_t i = 0; i < c->shared; i++)
        for (int64_t dof = 0; dof < nd; dof++)
            u[dof * c->nodes + c->copies[i]] = c->signs[nd * i + dof] * of_all[dof * common->nodes + c->shares[i]];
    const double *of_last = u + (nd - last) * c->nodes;
    double *on_last = force + (nd - last) * c->nodes;
    for (int64_t number = 0; number < c->blocks; number++) {
        const Block *b = c->block + number;
        const int nodes = (int)b->group->nodes, pairs = (int)b->group->pairs;
        switch (b->group->kind) {
        case ONE_MATRIX: NAME(one_matrix)(last, nodes, p, c, b, of_last, on_last); break;
        case TWO_MATRICES:
            if (pairs == 4 && nodes == 9)
                NAME(two_matrices)(last, 4, 1, p, c, b, of_last, on_last);
            else
                NAME(two_matrices)(last, pairs, nodes - 2 * pairs, p, c, b, of_last, on_last);
            break;
        case FACTORIZED:
            if (b->group->tying)
                NAME(tied)(last, p, c, b, of_last, on_last);
            else
                NAME(factorized)(last, 0, p, c, b, of_last, on_last);
            break;
        case TABULATED: NAME(tabulated)(last, nodes, p, c, b, of_last, on_last); break;
        }
        if (nonlinear) (b->group->curved ? NAME(curved_membrane) : NAME(membrane))(p, c, b, u, force, sums + 4);
    }
    for (int64_t i = 0; i < c->shared; i++)
        for (int64_t dof = 0; dof < nd; dof++)
            c->force[nd * i + dof] = c->signs[nd * i + dof] * force[dof * c->nodes + c->copies[i]];
    NAME(update)(nd, p, c, force, next, sums);
}

/* `force` is (nd, most); it is zero before and after. */
TARGET void NAME(run_linear)(const Plate *p, const Chunk *c, int next, double *force, half *sums) {
    if (p->nd == 3)
        NAME(chunk)(3, 0, p, c, next, force, sums);
    else
        NAME(chunk)(5, 0, p, c, next, force, sums);
}

TARGET void NAME(run_nonlinear)(const Plate *p, const Chunk *c, int next, double *force, half *sums) {
    NAME(chunk)(5, 1, p, c, next, force, sums);
}

TARGET void NAME(run_chunk)(const Plate *p, int64_t number, int next, double *force, half *sums) {
    memset(sums, 0, SUMS * sizeof *sums);
    (p->nonlinear ? NAME(run_nonlinear) : NAME(run_linear))(p, p->chunk + number, next, force, sums);
}

/* Add up the forces on shared nodes, update these nodes, and add up the sums of all chunks, (chunks, SUMS). */
TARGET Sums NAME(finish)(const Plate *p, int next, half *sums) {
    const int64_t nd = p->nd;
    const Chunk *common = p->chunk + p->chunks;
    half total[SUMS];
    memset(total, 0, sizeof total);
    for (int64_t number = 0; number < p->chunks; number++) {
        const Chunk *c = p->chunk + number;
        for (int64_t i = 0; i < c->shared; i++)
            for (int64_t dof = 0; dof < nd; dof++) p->shared[dof * common->nodes + c->shares[i]] += c->force[nd * i + dof];
        for (int i = 0; i < SUMS; i++) total[i] += sums[SUMS * number + i];
    }
    if (nd == 3)
        NAME(update)(3, p, common, p->shared, next, total);
    else
        NAME(update)(5, p, common, p->shared, next, total);
    double added[SUMS];
    for (int i = 0; i < SUMS; i++) added[i] = (total[i][0] + total[i][1]) + (total[i][2] + total[i][3]);
    return (Sums){added[0], added[1], added[2], added[3], added[4]};
}

/* Covariant shear strains of an element at its tying points, four at a time. */
INLINE void NAME(strains_at_tying)(const Strains *g, int64_t e, const double *u, double *strain) {
    const int64_t *node = g->node + g->nodes * e, n = g->tying;
    for (int64_t t = 0; t < n; t += 4) {
        half w = {0}, a = {0}, b = {0};
        const double *table = g->tying_table + t, *mapping = g->mapping + 2 * n * g->shape[e] + t;
        for (int64_t i = 0; i < g->nodes; i++, table += 2 * n) {
            const double *q = u + 5 * node[i];
            const half slope = NAME(load)(table), value = NAME(load)(table + n);
            w += q[2] * slope, a += q[3] * value, b += q[4] * value;
        }
        NAME(store)(strain + t, w - a * NAME(load)(mapping) - b * NAME(load)(mapping + n));
    }
}

/* Assumed shear strains at four points of an element. */
INLINE void NAME(assumed_strains)(const Strains *g, int64_t e, int64_t point, const double *tied, half *xz, half *yz) {
    half of_xi = {0}, of_eta = {0};
    const int64_t width = g->width, each = g->tying / 2;
    const double *one = g->tied + point, *other = one + each * width, *m = g->metric + 4 * width * g->shape[e] + point;
    for (int64_t i = 0; i < each; i++, one += width, other += width)
        of_xi += tied[i] * NAME(load)(one), of_eta += tied[each + i] * NAME(load)(other);
    *xz = NAME(load)(m) * of_xi + NAME(load)(m + width) * of_eta;
    *yz = NAME(load)(m + 2 * width) * of_xi + NAME(load)(m + 3 * width) * of_eta;
}

/* Curvatures x, y, xy and shear strains yz, xz, as StrainField evaluates them, four points at a time. */
TARGET void NAME(strains)(const Strains *g, int64_t fields, int64_t numnp, int64_t numel, const double *u, double *strains) {
    const int64_t width = g->width, points = g->points, component = fields * numel * points;
    for (int64_t field = 0; field < fields; field++, u += 5 * numnp)
        for (int64_t e = 0; e < g->elements; e++) {
            const int64_t *node = g->node + g->nodes * e;
            double *out = strains + (field * numel + g->row[e]) * points;
            double tied[TIED];
            NAME(strains_at_tying)(g, e, u, tied);
            for (int64_t p = 0; p < width; p += 4) {
                half w[2] = {{0}}, a[3] = {{0}}, b[3] = {{0}};
                const double *t = g->table + p;
                for (int64_t i = 0; i < g->nodes; i++, t += 3 * width) {
                    const double *q = u + 5 * node[i];
                    const half xi = NAME(load)(t), eta = NAME(load)(t + width), value = NAME(load)(t + 2 * width);
                    w[0] += q[2] * xi, w[1] += q[2] * eta;
                    a[0] += q[3] * xi, a[1] += q[3] * eta, a[2] += q[3] * value;
                    b[0] += q[4] * xi, b[1] += q[4] * eta, b[2] += q[4] * value;
                }
                const double *m = g->metric + 4 * width * g->shape[e] + p;
                const half xx = NAME(load)(m), xe = NAME(load)(m + width);
                const half yx = NAME(load)(m + 2 * width), ye = NAME(load)(m + 3 * width);
                half xz = xx * w[0] + xe * w[1] - a[2], yz = yx * w[0] + ye * w[1] - b[2];
                if (g->tying) NAME(assumed_strains)(g, e, p, tied, &xz, &yz);
                /* 0 - a avoids the negative zeros of a plate at rest. */
                const half found[5] = {
                    0.0 - (xx * a[0] + xe * a[1]), 0.0 - (yx * b[0] + ye * b[1]),
                    0.0 - (yx * a[0] + ye * a[1]) - (xx * b[0] + xe * b[1]), yz, xz};
                const int count = points - p < 4 ? (int)(points - p) : 4;
                for (int c = 0; c < 5; c++)
                    for (int i = 0; i < count; i++) out[c * component + p + i] = found[c][i];
            }
        }
}
