/* Midplane strains, curvatures and their derivatives, as PlyStresses evaluates them; included once for each
 * instruction set.
 *
 * Four points of an element are computed at once.  Sums run over the nodes in their order. */

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

/* Derivatives by x and y at the centre, (2, 6); `d` has those of the shape functions. */
INLINE void NAME(gradients)(const Midplane *g, const int64_t *node, const double *d, const double *u, double *out) {
    half xx = {0}, yy = {0}, xy = {0}; /* of u, v, theta_x, theta_y */
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
    memcpy(out, by_x, sizeof by_x);
    memcpy(out + 6, by_y, sizeof by_y);
    if (!of_w) return;
    for (int k = 0; g->curved && k < 3; k++) out[k] += g->curved[k] * w[3], out[6 + k] += g->curved[k] * w[4];
    if (!g->tying) return;
    const double x = w[3], y = w[4];
    out[0] += x * w[0], out[1] += y * w[2], out[2] += w[0] * y + x * w[2];
    out[6] += x * w[2], out[7] += y * w[1], out[8] += w[2] * y + x * w[1];
}

TARGET void NAME(midplane)(const Midplane *g, const double *u, double *strains, double *gradients) {
    const int64_t n = g->nodes, width = g->width;
    for (int64_t e = 0; e < g->elements; e++) {
        const int64_t *node = g->node + n * e, shape = g->shape[e];
        double tied[16], *out = strains + 6 * g->points * g->row[e], *slopes = gradients + 12 * g->row[e];
        if (g->tying) NAME(tied_components)(g, node, g->tying_metric + 4 * TYING * shape, u, tied);
        for (int64_t p = 0; p < width; p += 4) {
            half xi[4] = {{0}}, eta[4] = {{0}}, w = {0}; /* of u, v, theta_x, theta_y */
            const double *t = g->table + p;
            for (int64_t i = 0; i < n; i++, t += 3 * width) {
                const double *q = u + 5 * node[i];
                const half by_xi = NAME(load)(t), by_eta = NAME(load)(t + width);
                xi[0] += q[0] * by_xi, xi[1] += q[1] * by_xi, xi[2] += q[3] * by_xi, xi[3] += q[4] * by_xi;
                eta[0] += q[0] * by_eta, eta[1] += q[1] * by_eta, eta[2] += q[3] * by_eta, eta[3] += q[4] * by_eta;
                if (g->curved) w += q[2] * NAME(load)(t + 2 * width);
            }
            const double *m = g->metric + 4 * width * shape + p;
            const half xx = NAME(load)(m), xe = NAME(load)(m + width);
            const half yx = NAME(load)(m + 2 * width), ye = NAME(load)(m + 3 * width);
            half x[4], y[4];
            for (int i = 0; i < 4; i++) x[i] = xx * xi[i] + xe * eta[i], y[i] = yx * xi[i] + ye * eta[i];
            /* Curvatures are the strains of the rotations' negatives. */
            half found[6] = {x[0], y[1], y[0] + x[1], 0.0 - x[2], 0.0 - y[3], 0.0 - y[2] - x[3]};
            if (g->tying) {
                half covariant[3] = {{0}};
                for (int i = 0; i < 16; i++)
                    covariant[i < 6 ? 0 : i < 12 ? 1 : 2] += tied[i] * NAME(load)(g->tied + width * i + p);
                const double *to = g->tied_strain + 9 * shape;
                for (int k = 0; k < 3; k++, to += 3)
                    found[k] += to[0] * covariant[0] + to[1] * covariant[1] + to[2] * covariant[2];
            }
            for (int k = 0; g->curved && k < 3; k++) found[k] += g->curved[k] * w;
            for (int k = 0; k < 3; k++) found[k] += g->initial[k];
            const int count = g->points - p < 4 ? (int)(g->points - p) : 4;
            for (int i = 0; i < count; i++)
                for (int k = 0; k < 6; k++) out[6 * (p + i) + k] = found[k][i];
        }
        if (g->centre)
            NAME(gradients)(g, node, g->centre + 5 * n * shape, u, slopes);
        else
            for (int k = 0; k < 12; k++) slopes[k] = NAN;
    }
}
