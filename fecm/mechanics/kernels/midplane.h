/* Midplane strains, curvatures and their derivatives, as in PlyStresses; included once for each
 * instruction set.
 *
 ** 6 `strains` are three midplane strains and three curvatures; 3 `strains` are the curvatures.  Four points of
 * an element are computed at once.  Sums run over the nodes in their order. */

/* Components e_11 (6), e_22 (6) and e_12 (4) of the quadratic strains at their tying points. */
INLINE void NAME(tied_components)(const Midplane *g, const int64_t *node, const double *metric, const double *u, double *e) {
    ALIGNED double slope[2][TYING];
    for (int axis = 0; axis < 2; axis++)
        for (int t = 0; t < TYING; t += 4) {
            half xi = {0}, eta = {0};
            const double *at = g->tying + 2 * TYING * axis + t;
            for (int64_t i = 0; i < g->nodes; i++, at += 4 * TYING) {
                const double w = u[5 * node[i] + 2];
                xi += w * NAME(load)(at), eta += w * NAME(load)(at + TYING);
            }
            const double *m = metric + 2 * TYING * axis + t;
            NAME(store)(slope[axis] + t, NAME(load)(m) * xi + NAME(load)(m + TYING) * eta);
        }
    for (int t = 0; t < 6; t++) e[t] = 0.5 * slope[0][t] * slope[0][t], e[6 + t] = 0.5 * slope[1][t] * slope[1][t];
    for (int t = 0; t < 4; t++) e[12 + t] = slope[0][6 + t] * slope[1][6 + t];
}

/* Derivatives by x and y at the centre, (2, strains); `d` has the derivatives of the shape functions. */
INLINE void NAME(gradients)(const Midplane *g, const int64_t *node, const double *d, const double *u, int strains, double *out) {
    half xx = {0}, yy = {0}, xy = {0}; /* derivatives of u, v, theta_x, theta_y */
    double w[5] = {0.0};
    const int64_t n = g->nodes;
    const int of_w = g->curved || g->tying;
    for (int64_t i = 0; i < n; i++) {
        const double *q = u + 5 * node[i];
        const half of_node = {q[0], q[1], q[3], q[4]};
        xx += d[i] * of_node, yy += d[n + i] * of_node, xy += d[2 * n + i] * of_node;
        for (int k = 0; of_w && k < 5; k++) w[k] += d[k * n + i] * q[2];
    }
    const double by_x[6] = {xx[0], xy[1], xy[0] + xx[1], -xx[2], -xy[3], -xy[2] - xx[3]};
    const double by_y[6] = {xy[0], yy[1], yy[0] + xy[1], -xy[2], -yy[3], -yy[2] - xy[3]};
    memcpy(out, by_x + 6 - strains, strains * sizeof *out);
    memcpy(out + strains, by_y + 6 - strains, strains * sizeof *out);
    if (strains < 6) return;
    for (int k = 0; g->curved && k < 3; k++) out[k] += g->curved[k] * w[3], out[6 + k] += g->curved[k] * w[4];
    if (!g->tying) return;
    const double x = w[3], y = w[4];
    out[0] += x * w[0], out[1] += y * w[2], out[2] += w[0] * y + x * w[2];
    out[6] += x * w[2], out[7] += y * w[1], out[8] += w[2] * y + x * w[1];
}

/* Derivatives by x and y at four points of the dofs from `first` to `end` of u, v, theta_x, theta_y, w. */
INLINE void NAME(derivatives)(const Midplane *g, const int64_t *node, int64_t shape, int64_t point, int first, int end, const double *u, half *x, half *y) {
    static const int dofs[5] = {0, 1, 3, 4, 2};
    half xi[5] = {{0}}, eta[5] = {{0}};
    const double *t = g->table + point;
    for (int64_t i = 0; i < g->nodes; i++, t += 3 * g->width) {
        const double *q = u + 5 * node[i];
        const half by_xi = NAME(load)(t), by_eta = NAME(load)(t + g->width);
#pragma GCC unroll 5
        for (int k = first; k < end; k++) xi[k] += q[dofs[k]] * by_xi, eta[k] += q[dofs[k]] * by_eta;
    }
    const double *m = g->metric + 4 * g->width * shape + point;
    const half xx = NAME(load)(m), xe = NAME(load)(m + g->width);
    const half yx = NAME(load)(m + 2 * g->width), ye = NAME(load)(m + 3 * g->width);
#pragma GCC unroll 5
    for (int k = first; k < end; k++) x[k] = xx * xi[k] + xe * eta[k], y[k] = yx * xi[k] + ye * eta[k];
}

/* Midplane strains of four points. */
INLINE void NAME(stretching)(const Midplane *g, const int64_t *node, int64_t shape, int64_t point, const double *u, const double *tied, const half *x, const half *y, half *found) {
    const int64_t width = g->width;
    found[0] = x[0], found[1] = y[1], found[2] = y[0] + x[1];
    if (g->tying) {
        half covariant[3] = {{0}};
        for (int i = 0; i < 16; i++)
            covariant[i < 6 ? 0 : i < 12 ? 1 : 2] += tied[i] * NAME(load)(g->tied + width * i + point);
        const double *to = g->tied_strain + 9 * shape;
        for (int k = 0; k < 3; k++, to += 3)
            found[k] += to[0] * covariant[0] + to[1] * covariant[1] + to[2] * covariant[2];
    }
    if (g->curved) {
        half w = {0};
        for (int64_t i = 0; i < g->nodes; i++)
            w += u[5 * node[i] + 2] * NAME(load)(g->table + (3 * i + 2) * width + point);
        for (int k = 0; k < 3; k++) found[k] += g->curved[k] * w;
    }
    for (int k = 0; k < 3; k++) found[k] += g->initial[k];
}

/* Strains at the points, (elements, points, strains), and their derivatives at the centres, (elements, 2, strains). */
INLINE void NAME(midplane)(const Midplane *g, const double *u, int strains, double *strain, double *gradient) {
    for (int64_t element = 0; element < g->elements; element++) {
        const int64_t *node = g->node + g->nodes * element, shape = g->shape[element], row = g->row[element];
        double tied[16], *out = strain + strains * g->points * row, *slopes = gradient + 2 * strains * row;
        if (strains == 6 && g->tying) NAME(tied_components)(g, node, g->tying_metric + 4 * TYING * shape, u, tied);
        for (int64_t point = 0; point < g->width; point += 4) {
            half x[4], y[4], found[6];
            NAME(derivatives)(g, node, shape, point, strains == 6 ? 0 : 2, 4, u, x, y);
            if (strains == 6) NAME(stretching)(g, node, shape, point, u, tied, x, y, found);
            /* Curvatures are the strains of the negative rotations. */
            found[3] = 0.0 - x[2], found[4] = 0.0 - y[3], found[5] = 0.0 - y[2] - x[3];
            for (int i = 0; i < 4 && point + i < g->points; i++)
                for (int k = 6 - strains; k < 6; k++) *out++ = found[k][i];
        }
        if (g->centre)
            NAME(gradients)(g, node, g->centre + 5 * g->nodes * shape, u, strains, slopes);
        else
            for (int k = 0; k < 2 * strains; k++) slopes[k] = NAN;
    }
}
