/* Energies, slopes, strains and membrane forces of the midplane of a nonlinear plate, as stretching.py has them;
 * included once for each instruction set.
 *
 ** Four points of an element are computed at once.  Sums run over the elements and their points in order, then over
 * the four lanes.  A padded point has no area, and its lane is left out of the largest values. */

/* v C v with a symmetric C (3, 3). */
INLINE half NAME(form)(const double *C, const half *v) {
    half sum = {0};
    for (int i = 0; i < 3; i++) sum += v[i] * (C[3 * i] * v[0] + C[3 * i + 1] * v[1] + C[3 * i + 2] * v[2]);
    return sum;
}

/* Half difference of the principal values of xx, yy, xy. */
INLINE half NAME(radius)(half xx, half yy, half xy) {
    const half d = 0.5 * (xx - yy);
    return ROOT(d * d + xy * xy);
}

/* Largest absolute principal strain of both faces. */
INLINE half NAME(face)(const half *middle, const half *kappa, half z) {
    half largest = {0};
    for (int side = 0; side < 2; side++, z = -z) {
        const half xx = middle[0] + z * kappa[0], yy = middle[1] + z * kappa[1], xy = middle[2] + z * kappa[2];
        largest = LARGER(NAME(size)(0.5 * (xx + yy)) + NAME(radius)(xx, yy, 0.5 * xy), largest);
    }
    return largest;
}

INLINE void NAME(stretched)(const Stretched *x, const double *u, half *energy, double *largest) {
    const Midplane *g = &x->midplane;
    const Strains *s = &x->sheared;
    for (int64_t element = 0; element < g->elements; element++) {
        const int64_t *node = g->node + g->nodes * element, shape = g->shape[element];
        double tied[16], at_tying[TIED];
        NAME(tied_components)(g, node, g->tying_metric + 4 * TYING * shape, u, tied);
        for (int64_t point = 0, at = g->width * element; point < g->width; point += 4, at += 4) {
            half by_x[5], by_y[5], eps[3], middle[3], n[3];
            NAME(derivatives)(g, node, shape, point, 0, 5, u, by_x, by_y);
            NAME(stretching)(g, node, shape, point, u, tied, by_x, by_y, eps);
            const half kappa[3] = {-by_x[2], -by_y[3], -by_y[2] - by_x[3]}, wx = by_x[4], wy = by_y[4];
            for (int i = 0; i < 3; i++) {
                const double *A = x->stretching + 3 * i, *B = x->coupling + 3 * i;
                n[i] = A[0] * eps[0] + A[1] * eps[1] + A[2] * eps[2];
                n[i] += B[0] * kappa[0] + B[1] * kappa[1] + B[2] * kappa[2];
                middle[i] = eps[i] + x->preload_strain[i];
            }
            const double *N = x->preload;
            const half area = NAME(load)(x->area + at), z = NAME(load)(x->half + at);
            energy[MEMBRANE] += area * NAME(form)(x->compliance, n);
            energy[BENDING] += area * NAME(form)(x->bending, kappa);
            energy[OF_PRELOAD] += area * (wx * wx * N[0] + wy * wy * N[1] + 2.0 * wx * wy * N[2]);
            for (int i = 0; i < 3; i++) n[i] += N[i];
            const half slope = ROOT(wx * wx + wy * wy), face = NAME(face)(middle, kappa, z);
            const half force = 0.5 * (n[0] + n[1]) + NAME(radius)(n[0], n[1], n[2]);
            for (int lane = 0; lane < 4 && point + lane < g->points; lane++) {
                if (slope[lane] > largest[SLOPE]) largest[SLOPE] = slope[lane];
                if (z[lane] > 0.0 && face[lane] > largest[FACE]) largest[FACE] = face[lane];
                if (force[lane] > largest[MEMBRANE_FORCE]) largest[MEMBRANE_FORCE] = force[lane];
            }
        }
        NAME(strains_at_tying)(s, element, u, at_tying);
        const double *S = x->transverse;
        for (int64_t point = 0; point < s->width; point += 4) {
            half xz, yz;
            NAME(assumed_strains)(s, element, point, at_tying, &xz, &yz);
            const half area = NAME(load)(x->shear_area + s->width * element + point);
            energy[SHEARING] += area * (xz * (S[0] * xz + S[1] * yz) + yz * (S[2] * xz + S[3] * yz));
        }
    }
}

/* Values of a displacement field, (STRETCHED,). */
TARGET void NAME(midplanes)(const Stretched *families, int64_t count, const double *u, double *found) {
    half energy[SLOPE] = {{0}};
    found[SLOPE] = found[FACE] = 0.0, found[MEMBRANE_FORCE] = -HUGE_VAL;
    for (int64_t i = 0; i < count; i++) NAME(stretched)(families + i, u, energy, found);
    for (int i = 0; i < SLOPE; i++) found[i] = 0.5 * (energy[i][0] + energy[i][1] + energy[i][2] + energy[i][3]);
}

/* Midplane strains and curvatures, (count, 6), of elements that have one point. */
TARGET void NAME(midplanes_at)(const Midplane *elements, int64_t count, const double *u, double *strain) {
    for (const Midplane *g = elements; g < elements + count; g++, strain += 6) {
        half by_x[5], by_y[5], eps[3];
        double tied[16];
        NAME(tied_components)(g, g->node, g->tying_metric, u, tied);
        NAME(derivatives)(g, g->node, 0, 0, 0, 4, u, by_x, by_y);
        NAME(stretching)(g, g->node, 0, 0, u, tied, by_x, by_y, eps);
        for (int i = 0; i < 3; i++) strain[i] = eps[i][0];
        strain[3] = -by_x[2][0], strain[4] = -by_y[3][0], strain[5] = -by_y[2][0] - by_x[3][0];
    }
}
