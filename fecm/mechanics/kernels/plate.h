/* K u of a plate, and strains; included once for each instruction set. */

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

/* Rows of four nodes as columns, x (nd,). */
INLINE void NAME(columns)(int nd, const int32_t *from, const double *u, half *x) {
    const int64_t entries = nd == 3 ? 4 : nd;
    const double *p0 = u + entries * from[0], *p1 = u + entries * from[1];
    const double *p2 = u + entries * from[2], *p3 = u + entries * from[3];
    const half r0 = NAME(load)(p0), r1 = NAME(load)(p1), r2 = NAME(load)(p2), r3 = NAME(load)(p3);
    const half t0 = __builtin_shufflevector(r0, r1, 0, 4, 2, 6), t1 = __builtin_shufflevector(r0, r1, 1, 5, 3, 7);
    const half t2 = __builtin_shufflevector(r2, r3, 0, 4, 2, 6), t3 = __builtin_shufflevector(r2, r3, 1, 5, 3, 7);
    x[0] = __builtin_shufflevector(t0, t2, 0, 1, 4, 5);
    x[1] = __builtin_shufflevector(t1, t3, 0, 1, 4, 5);
    x[2] = __builtin_shufflevector(t0, t2, 2, 3, 6, 7);
    if (nd == 5) {
        x[3] = __builtin_shufflevector(t1, t3, 2, 3, 6, 7);
        x[4] = (half){p0[4], p1[4], p2[4], p3[4]};
    }
}

/* Add y (nd,), columns of four nodes, to the rows of their forces. */
INLINE void NAME(add_columns)(int nd, const int32_t *to, const half *y, double *f) {
    const int64_t entries = nd == 3 ? 4 : nd;
    const half r3 = nd == 5 ? y[3] : (half){0};
    const half t0 = __builtin_shufflevector(y[0], y[1], 0, 4, 2, 6), t1 = __builtin_shufflevector(y[0], y[1], 1, 5, 3, 7);
    const half t2 = __builtin_shufflevector(y[2], r3, 0, 4, 2, 6), t3 = __builtin_shufflevector(y[2], r3, 1, 5, 3, 7);
    const half rows[4] = {
        __builtin_shufflevector(t0, t2, 0, 1, 4, 5), __builtin_shufflevector(t1, t3, 0, 1, 4, 5),
        __builtin_shufflevector(t0, t2, 2, 3, 6, 7), __builtin_shufflevector(t1, t3, 2, 3, 6, 7)};
    for (int lane = 0; lane < 4; lane++) {
        double *p = f + entries * to[lane];
        NAME(store)(p, NAME(load)(p) + rows[lane]);
        if (nd == 5) p[4] += y[4][lane];
    }
}

/* Displacements (nd, nodes) of eight elements, and their forces y added to those of the nodes. */
INLINE void NAME(gather)(int nd, int nodes, const Block *b, const double *u, lanes *x) {
    half r[5];
    for (int node = 0; node < nodes; node++)
        for (int side = 0; side < 2; side++) {
            NAME(columns)(nd, b->from + LANES * node + 4 * side, u, r);
            for (int dof = 0; dof < nd; dof++) HALF(x[dof * nodes + node]) = r[dof];
        }
}

INLINE void NAME(scatter)(int nd, int nodes, const Block *b, const lanes *y, double *f) {
    half r[5];
    for (int node = 0; node < nodes; node++)
        for (int side = 0; side < 2; side++) {
            for (int dof = 0; dof < nd; dof++) r[dof] = HALF(y[dof * nodes + node]);
            NAME(add_columns)(nd, b->to + LANES * node + 4 * side, r, f);
        }
}

/* Elements with one matrix. */
INLINE void NAME(one_matrix)(int nd, int nodes, const Block *b, const double *u, double *f) {
    lanes x[60] ALIGNED, y[60] ALIGNED;
    NAME(gather)(nd, nodes, b, u, x);
    NAME(product)(b->group->matrix, nd * nodes, nd * nodes, x, y);
    NAME(scatter)(nd, nodes, b, y, f);
}

/* Elements with one matrix for even motions and one for odd ones: under half a turn w keeps its sign,
 * the other dofs change it.  Each has its dofs in order, (pairs,) or (pairs + 1,) with the centre. */
INLINE void NAME(two_matrices)(int nd, int pairs, int centre, const Block *b, const double *u, double *f) {
    const int w = nd == 5 ? 2 : 0, even = nd * pairs + centre, odd = nd * (pairs + centre) - centre;
    const double *matrix = b->group->matrix;
    lanes x[60] ALIGNED, y[60] ALIGNED;
    half one[5] ALIGNED, other[5] ALIGNED = {{0}};
    for (int node = 0; node < pairs + centre; node++)
        for (int side = 0; side < 2; side++) {
            const int32_t *from = b->from + LANES * (node < pairs ? node : 2 * pairs) + 4 * side;
            NAME(columns)(nd, from, u, one);
            if (node < pairs) NAME(columns)(nd, from + LANES * pairs, u, other);
            for (int dof = 0, e = node, o = even + node; dof < nd; dof++) {
                if (node == pairs)
                    HALF(x[dof == w ? e : o]) = one[dof];
                else {
                    HALF(x[dof == w ? e : o]) = one[dof] + other[dof];
                    HALF(x[dof == w ? o : e]) = one[dof] - other[dof];
                }
                e += pairs + (dof == w ? centre : 0), o += pairs + (dof == w ? 0 : centre);
            }
        }
    NAME(product)(matrix, even, even, x, y);
    NAME(product)(matrix + even * even, odd, odd, x + even, y + even);
    for (int node = 0; node < pairs + centre; node++)
        for (int side = 0; side < 2; side++) {
            const int32_t *to = b->to + LANES * (node < pairs ? node : 2 * pairs) + 4 * side;
            for (int dof = 0, e = node, o = even + node; dof < nd; dof++) {
                const half sum = HALF(y[dof == w ? e : o]);
                one[dof] = sum;
                if (node < pairs) {
                    const half rest = HALF(y[dof == w ? o : e]);
                    one[dof] = sum + rest, other[dof] = sum - rest;
                }
                e += pairs + (dof == w ? centre : 0), o += pairs + (dof == w ? 0 : centre);
            }
            NAME(add_columns)(nd, to, one, f);
            if (node < pairs) NAME(add_columns)(nd, to + LANES * pairs, other, f);
        }
}

/* Strains at the points of quadrature from values and slopes in xi and eta, stresses, and back. */
INLINE void NAME(no_matrix)(int nd, int nodes, const Plate *p, const Block *b, double *f) {
    const Group *g = b->group;
    const double *data = b->data;
    lanes x[60] ALIGNED, y[60] ALIGNED;
    NAME(gather)(nd, nodes, b, p->u, x);
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
                const lanes *const c = at_u[0] + point, *const d = at_u[1] + point;
                from = 0;
                strain[0] = xx * HALF(c[0]) + xe * HALF(c[nb]);
                strain[1] = yx * HALF(d[0]) + ye * HALF(d[nb]);
                strain[2] = yx * HALF(c[0]) + ye * HALF(c[nb]) + xx * HALF(d[0]) + xe * HALF(d[nb]);
            }
            for (int i = from; i < 6; i++) {
                half sum = zero;
                for (int j = from; j < 6; j++) sum += C[6 * i + j] * strain[j];
                stress[i] = jxw * sum;
            }
            HALF(a[0]) = xx * stress[3] + yx * stress[5], HALF(a[nb]) = xe * stress[3] + ye * stress[5];
            HALF(b[0]) = xx * stress[5] + yx * stress[4], HALF(b[nb]) = xe * stress[5] + ye * stress[4];
            if (nd == 5) {
                lanes *const c = at_u[0] + point, *const d = at_u[1] + point;
                HALF(c[0]) = xx * stress[0] + yx * stress[2], HALF(c[nb]) = xe * stress[0] + ye * stress[2];
                HALF(d[0]) = xx * stress[2] + yx * stress[1], HALF(d[nb]) = xe * stress[2] + ye * stress[1];
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
#undef G
    lanes *const yw = y + first * nodes;
    NAME(product)(g->deflection_t, nodes, slopes, at_w, yw);
    for (int i = 0; i < 2; i++) {
        NAME(product)(g->rotations_t, nodes, 2 * nb + values, at_r[i], yw + (1 + i) * nodes);
        if (nd == 5) NAME(product)(g->in_plane_t, nodes, 2 * nb, at_u[i], y + i * nodes);
    }
    NAME(scatter)(nd, nodes, b, y, f);
}

/* Biquadratic elements with the points of a tensor product, by sum factorization.
 *
 * A quadratic a, b, c at -1, 0, 1 has the coefficients c0 = b, c1 = c - a, c2 = a - 2 b + c: its value
 * is c0 + c1 x/2 + c2 x^2/2, and twice its slope c1 + 2 c2 x.  Points are ascending and symmetric, so
 * that even and odd parts give those at x and -x at once.  Four elements at a time. */
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

#define AT(k) NAME(load)(data + (k) * LANES)
/* Forces on the coefficients, of membrane and bending strains at n x n points. */
INLINE void NAME(bending)(int nd, int n, const Plate *p, const double *x, const double *data, half (*c)[9], half (*force)[9]) {
    const int fields = nd - 1, from = nd == 5 ? 0 : 3; /* u, v if they move, theta_x, theta_y */
    const double *C = p->stiffness;
    half V[4][2][4] ALIGNED, D[4][3][4] ALIGNED;
    for (int i = 0; i < fields; i++) {
        const half *f = c[i < fields - 2 ? i : i + 1];
        for (int b = 0; b < 3; b++, f += 3) {
            NAME(slopes)(n, x, f[1], f[2], D[i][b], 1);
            if (b) NAME(values)(n, x, f[0], f[1], f[2], V[i][b - 1], 1);
        }
    }
    for (int k = 0; k < n; k++) {
        half along[4][4] ALIGNED, across[4][4] ALIGNED;
        for (int i = 0; i < fields; i++) {
            NAME(values)(n, x, D[i][0][k], D[i][1][k], D[i][2][k], along[i], 1);
            NAME(slopes)(n, x, V[i][0][k], V[i][1][k], across[i], 1);
        }
        for (int l = 0; l < n; l++, data += 4 * LANES) {
            const half xx = AT(0), xe = AT(1), yx = AT(2), ye = AT(3);
            half strain[6], stress[6];
            for (int i = 0; i < fields; i += 2) {
                half *e = strain + (i < fields - 2 ? 0 : 3);
                const half a = along[i][l], b = across[i][l], d = along[i + 1][l], g = across[i + 1][l];
                e[0] = xx * a + xe * b, e[1] = yx * d + ye * g;
                e[2] = yx * a + ye * b + (xx * d + xe * g);
            }
            for (int i = from; i < 6; i++) {
                stress[i] = C[6 * i + from] * strain[from];
                for (int j = from + 1; j < 6; j++) stress[i] += C[6 * i + j] * strain[j];
            }
            for (int i = 0; i < fields; i += 2) {
                const half *s = stress + (i < fields - 2 ? 0 : 3);
                along[i][l] = xx * s[0] + yx * s[2], across[i][l] = xe * s[0] + ye * s[2];
                along[i + 1][l] = xx * s[2] + yx * s[1], across[i + 1][l] = xe * s[2] + ye * s[1];
            }
        }
        for (int i = 0; i < fields; i++) {
            half d[3] = {{0}}, v[2] = {{0}};
            NAME(sum_values)(n, x, along[i], 1, d, d + 1, d + 2);
            NAME(sum_slopes)(n, x, across[i], 1, v, v + 1);
            D[i][0][k] = d[0], D[i][1][k] = d[1], D[i][2][k] = d[2], V[i][0][k] = v[0], V[i][1][k] = v[1];
        }
    }
    for (int i = 0; i < fields; i++) {
        half *f = force[i < fields - 2 ? i : i + 1];
        for (int b = 0; b < 3; b++, f += 3) {
            half sum[3] = {{0}};
            NAME(sum_slopes)(n, x, D[i][b], 1, sum + 1, sum + 2);
            if (b) NAME(sum_values)(n, x, V[i][b - 1], 1, sum, sum + 1, sum + 2);
            f[0] = sum[0], f[1] = sum[1], f[2] = sum[2];
        }
    }
}

/* Add those of transverse shear strains, which are the only ones on w. */
INLINE void NAME(shear)(int n, const Plate *p, const double *x, const double *data, half (*c)[9], half (*force)[9]) {
    const double *S = p->shear;
    const half zero = {0};
    half V[3][3][4] ALIGNED, D[3][4] ALIGNED; /* values of w, theta_x, theta_y along xi; slopes of w */
    for (int i = 0; i < 3; i++)
        for (int b = 0; b < 3; b++) {
            const half *f = c[i] + 3 * b;
            NAME(values)(n, x, f[0], f[1], f[2], V[i][b], 1);
            if (!i) NAME(slopes)(n, x, f[1], f[2], D[b], 1);
        }
    for (int k = 0; k < n; k++) {
        half along[4] ALIGNED, across[4] ALIGNED, angle[2][4] ALIGNED;
        NAME(values)(n, x, D[0][k], D[1][k], D[2][k], along, 1);
        NAME(slopes)(n, x, V[0][1][k], V[0][2][k], across, 1);
        for (int i = 0; i < 2; i++)
            NAME(values)(n, x, V[i + 1][0][k], V[i + 1][1][k], V[i + 1][2][k], angle[i], 1);
        for (int l = 0; l < n; l++, data += 5 * LANES) {
            const half xx = AT(0), xe = AT(1), yx = AT(2), ye = AT(3), root = AT(4);
            const half sx = xx * along[l] + xe * across[l] - root * angle[0][l];
            const half sy = yx * along[l] + ye * across[l] - root * angle[1][l];
            const half qx = S[0] * sx + S[1] * sy, qy = S[2] * sx + S[3] * sy;
            along[l] = xx * qx + yx * qy, across[l] = xe * qx + ye * qy;
            angle[0][l] = -root * qx, angle[1][l] = -root * qy;
        }
        half d[3] = {{0}}, v[3][3] = {{{0}}};
        NAME(sum_values)(n, x, along, 1, d, d + 1, d + 2);
        NAME(sum_slopes)(n, x, across, 1, v[0] + 1, v[0] + 2);
        for (int i = 1; i < 3; i++) NAME(sum_values)(n, x, angle[i - 1], 1, v[i], v[i] + 1, v[i] + 2);
        for (int b = 0; b < 3; b++) {
            D[b][k] = d[b];
            for (int i = 0; i < 3; i++) V[i][b][k] = v[i][b];
        }
    }
    for (int i = 0; i < 3; i++)
        for (int b = 0; b < 3; b++) {
            half *f = force[i] + 3 * b, sum[3] = {{0}};
            if (i || b) NAME(sum_values)(n, x, V[i][b], 1, sum, sum + 1, sum + 2);
            if (!i) NAME(sum_slopes)(n, x, D[b], 1, sum + 1, sum + 2);
            for (int a = 0; a < 3; a++) f[a] = sum[a] + (i ? f[a] : zero);
        }
}
#undef AT

INLINE void NAME(factorized)(int nd, const Plate *p, const Block *b, double *f) {
    const Group *g = b->group;
    const int w = nd - 3;
    for (int side = 0; side < 2; side++) {
        const double *data = b->data + 4 * side, *after = data + 4 * LANES * g->bending * g->bending;
        half c[5][9] ALIGNED, force[5][9] ALIGNED, r[5] ALIGNED;
        for (int node = 0; node < 9; node++) {
            NAME(columns)(nd, b->from + LANES * node + 4 * side, p->u, r);
            for (int dof = 0; dof < nd; dof++) c[dof][node] = r[dof];
        }
        for (int dof = 0; dof < nd; dof++) NAME(coefficients)(c[dof]);
        switch (g->bending) {
        case 1: NAME(bending)(nd, 1, p, g->rotations, data, c, force); break;
        case 2: NAME(bending)(nd, 2, p, g->rotations, data, c, force); break;
        case 3: NAME(bending)(nd, 3, p, g->rotations, data, c, force); break;
        case 4: NAME(bending)(nd, 4, p, g->rotations, data, c, force); break;
        }
        switch (g->shear) {
        case 1: NAME(shear)(1, p, g->deflection, after, c + w, force + w); break;
        case 2: NAME(shear)(2, p, g->deflection, after, c + w, force + w); break;
        case 3: NAME(shear)(3, p, g->deflection, after, c + w, force + w); break;
        case 4: NAME(shear)(4, p, g->deflection, after, c + w, force + w); break;
        }
        for (int dof = 0; dof < nd; dof++) NAME(nodal)(force[dof]);
        for (int node = 0; node < 9; node++) {
            for (int dof = 0; dof < nd; dof++) r[dof] = force[dof][node];
            NAME(add_columns)(nd, b->to + LANES * node + 4 * side, r, f);
        }
    }
}

/* Scale the internal forces of nodes, add to the sums, and take the next step if asked to. */
INLINE void NAME(update)(int nd, const Plate *p, int64_t first, int64_t count, double *force, int next, half *sums) {
    const int64_t entries = nd == 3 ? 4 : nd;
    const double keep = 1.0 - p->damping, share = 1.0 / (1.0 + p->damping);
    const int32_t *const kind = p->kind;
    const double *const masses = p->mass, *const scales = p->scale, *const factor = p->factor;
    double *u = p->u + entries * first, *d = p->d + entries * first, *s = p->s + entries * first;
    const half zero = {0};
    half inertia = sums[0], power = sums[1], strain = sums[2], internal = sums[3];
    for (int64_t node = first; node < first + count; node++) {
        const double *mass = masses + entries * kind[node], *scale = scales + entries * kind[node];
        const double heavy = factor ? factor[2 * node] : 1.0, light = factor ? factor[2 * node + 1] : 1.0;
        const half f = NAME(load)(force), old = NAME(load)(d), v = NAME(load)(u);
        const half scaled = f * (light * NAME(load)(scale));
        NAME(store)(force, zero);
        inertia += heavy * NAME(load)(mass) * old * old;
        power += old * f, strain += v * f, internal += f * scaled;
        if (next) {
            const half now = (keep * old - scaled) * share;
            NAME(store)(d, now);
            NAME(store)(u, v + now);
        } else
            NAME(store)(s, scaled);
        if (nd == 5) {
            const double f4 = force[4], old4 = d[4], scaled4 = f4 * (light * scale[4]);
            force[4] = 0.0;
            inertia[0] += heavy * mass[4] * old4 * old4;
            power[0] += old4 * f4, strain[0] += u[4] * f4, internal[0] += f4 * scaled4;
            if (next) {
                d[4] = (keep * old4 - scaled4) * share;
                u[4] += d[4];
            } else
                s[4] = scaled4;
        }
        force += entries, u += entries, d += entries, s += entries;
    }
    sums[0] = inertia, sums[1] = power, sums[2] = strain, sums[3] = internal;
}

/* Forces of a chunk; its own nodes are updated as soon as their forces are complete. */
INLINE void NAME(chunk)(int nd, const Plate *p, const Chunk *chunk, int next, double *force, half *sums) {
    int64_t done = 0;
    for (int64_t number = 0; number < chunk->blocks; number++) {
        const Block *b = chunk->block + number;
        const int nodes = (int)b->group->nodes, pairs = (int)b->group->pairs;
        switch (b->group->kind) {
        case ONE: NAME(one_matrix)(nd, nodes, b, p->u, force); break;
        case TWO:
            if (pairs == 4 && nodes == 9)
                NAME(two_matrices)(nd, 4, 1, b, p->u, force);
            else
                NAME(two_matrices)(nd, pairs, nodes - 2 * pairs, b, p->u, force);
            break;
        case FACTORIZED: NAME(factorized)(nd, p, b, force); break;
        case POINTS: NAME(no_matrix)(nd, nodes, p, b, force); break;
        }
        if (b->done > done) {
            NAME(update)(nd, p, chunk->first + done, b->done - done, force + p->nd * done, next, sums);
            done = b->done;
        }
    }
    /* What is shared, and behind it what lanes without an element have added. */
    force += p->nd * chunk->nodes;
    memcpy(chunk->force, force, sizeof(double) * p->nd * chunk->shared);
    memset(force, 0, sizeof(double) * p->nd * (chunk->shared + 1));
}

/* `force` is (most, nd) and zero, before and after. */
TARGET void NAME(run_chunk)(const Plate *p, int64_t number, int next, double *force, half *sums) {
    memset(sums, 0, 4 * sizeof *sums);
    if (p->nd == 4)
        NAME(chunk)(3, p, p->chunk + number, next, force, sums);
    else
        NAME(chunk)(5, p, p->chunk + number, next, force, sums);
}

/* Add up what the chunks share, update it, and add up the sums of all, (chunks, 4). */
TARGET Sums NAME(finish)(const Plate *p, int next, half *sums) {
    const int64_t nd = p->nd;
    half total[4];
    memset(total, 0, sizeof total);
    for (int64_t number = 0; number < p->chunks; number++) {
        const Chunk *chunk = p->chunk + number;
        for (int64_t node = 0; node < chunk->shared; node++)
            for (int64_t dof = 0; dof < nd; dof++)
                p->shared[nd * (chunk->shares[node] - p->own) + dof] +=
                    chunk->signs[nd * node + dof] * chunk->force[nd * node + dof];
        for (int i = 0; i < 4; i++) total[i] += sums[4 * number + i];
    }
    if (nd == 4)
        NAME(update)(3, p, p->own, p->nodes - p->own, p->shared, next, total);
    else
        NAME(update)(5, p, p->own, p->nodes - p->own, p->shared, next, total);
    double added[4];
    for (int i = 0; i < 4; i++) added[i] = (total[i][0] + total[i][1]) + (total[i][2] + total[i][3]);
    return (Sums){added[0], added[1], added[2], added[3]};
}

/* Curvatures x, y, xy and shear strains yz, xz, as StrainField evaluates them, four points at a time. */
TARGET void NAME(strains)(const Strains *g, int64_t fields, int64_t numnp, int64_t numel, const double *u, double *strains) {
    const int64_t width = g->width, points = g->points, component = fields * numel * points;
    for (int64_t field = 0; field < fields; field++, u += 5 * numnp)
        for (int64_t e = 0; e < g->elements; e++) {
            const int64_t *node = g->node + g->nodes * e;
            double *out = strains + (field * numel + g->row[e]) * points;
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
                /* 0 - a, as -a would give negative zeros of a plate at rest. */
                const half found[5] = {
                    0.0 - (xx * a[0] + xe * a[1]), 0.0 - (yx * b[0] + ye * b[1]),
                    0.0 - (yx * a[0] + ye * a[1]) - (xx * b[0] + xe * b[1]),
                    yx * w[0] + ye * w[1] - b[2], xx * w[0] + xe * w[1] - a[2]};
                const int count = points - p < 4 ? (int)(points - p) : 4;
                for (int c = 0; c < 5; c++)
                    for (int i = 0; i < count; i++) out[c * component + p + i] = found[c][i];
            }
        }
}
