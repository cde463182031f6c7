/* Membrane of a nonlinear plate; included by plate.h, once for each instruction set.
 *
 * Theory: "Plate that stretches" in docs/theory.md.  With moderate slopes (von Karman) the midplane strains
 * are eps = eps_l + eps_q, eps_l = (u,x, v,y, u,y + v,x) and eps_q = (w,x^2/2, w,y^2/2, w,x w,y), and
 *
 *   N = N0 + A eps + B kappa,   M = B eps + D kappa.
 *
 ** D kappa, transverse shear, and N0 on the slopes are linear in w, theta_x and theta_y.  The four kinds of
 * plate.h compute them with the last three dofs.  This file computes the rest: the forces of A eps + B kappa on
 * u, v and w, and the forces of B eps on the rotations.
 *
 ** Frame.  The base vectors of an element are x_1 = x,xi and x_2 = x,eta at its centre.  U_a = x_a (u, v) and
 * T_a = x_a (theta_x, theta_y) are displacements and rotations along them.  D_a = R_ab d/dxi_b is the
 * derivative along x_a, with R = J_c J^-1 from the Jacobians at the centre and at a point.  Covariant strains:
 *
 **   e_11 = D_1 U_1,   e_22 = D_2 U_2,   e_12 = D_1 U_2 + D_2 U_1,   curvatures likewise from -T.
 *
 * Their stiffnesses are A_c = T' A T and B_c = T' B T, where T maps covariant strains to strains in x and y.  On
 * parallelograms R = 1.
 *
 * Tying.  With w,a = D_a w, the quadratic part of e_11 is w,1^2/2 at xi = +-1/sqrt(3), eta = 0, +-sqrt(3/5).
 * The quadratic part of e_22 is w,2^2/2 at the points with xi and eta exchanged.  The quadratic part of e_12 is
 * w,1 w,2 at xi, eta = +-1/sqrt(3).  Between these points the strains are interpolated.  With eps_q of every
 * point, a plate that bends without stretching would be too stiff (Bucalem and Bathe 1993).  With the base
 * vectors of the tying points, a constant membrane force would not be exact (Wisniewski and Panasz 2013).
 *
 * Parallelograms.  e_11, linear and tied, is linear in xi and quadratic in eta; e_22 is linear in eta and
 * quadratic in xi; e_12 is a sum of both forms.  Each strain is a sum of some of eight orthogonal modes,
 *
 *   0: 1   1: xi/2   2: eta/2   3: xi eta   4: p(xi)/2   5: p(xi) eta   6: p(eta)/2   7: p(eta) xi,
 *
 * with p(x) = x^2 - 1/3; e_11 has no 4 and 5, e_22 no 6 and 7.  The 3 x 3 points integrate their products
 ** exactly.  The energy is therefore a sum over the modes, and only the slopes of w are computed at points.
 *
 * Other elements.  Slopes along xi and eta are computed at the 9 points and at the tying points, by sums along
 * xi and then along eta as in FACTORIZED elements.  The strains there follow with R.
 *
 * Data of a block.  `membrane` starts with x_1/2 and x_2/2 (4), because `slopes` gives twice the slopes, and
 * with the upper triangles of A_c and -B_c (6 + 6), which for parallelograms are multiplied by determinant and
 * weight.  Other elements also have R_1/2 at the tying points of e_11 (6, 2), R_2/2 at the tying points of e_22
 * (6, 2), and both at the tying points of e_12 (4, 4), and the numbers of FACTORIZED elements (17): a factor, and
 * coefficients of x and y.
 *
 * Curved plate.  The covariant strains contain w/R at the points; 1/R are the last numbers (3) of every
 * element.  No element is treated as a parallelogram, because the modes do not contain w.
 *
 * Functions compute four elements at a time and are followed by their transposes.  Coefficients c, and forces
 * on them, belong to U_1, U_2, w, T_1, T_2.  Slopes are doubled.
 */

#define AT(i) NAME(load)(data + LANES * (i))

/* n = C e with the upper triangle of C (3, 3).  Without `first` or `second`, e_1 or e_2 is 0 and n_1 or n_2 is
 * not computed. */
INLINE void NAME(stresses)(int first, int second, const half *C, const half *e, half *n) {
    if (first && second) {
        n[0] = C[0] * e[0] + C[1] * e[1] + C[2] * e[2];
        n[1] = C[1] * e[0] + C[3] * e[1] + C[4] * e[2];
        n[2] = C[2] * e[0] + C[4] * e[1] + C[5] * e[2];
    } else if (first)
        n[0] = C[0] * e[0] + C[2] * e[2], n[2] = C[2] * e[0] + C[5] * e[2];
    else
        n[1] = C[3] * e[1] + C[4] * e[2], n[2] = C[4] * e[1] + C[5] * e[2];
}

/* Modes of the slopes of a biquadratic along xi and along eta. */
INLINE void NAME(slope_modes)(const half *c, half *xi, half *eta) {
    xi[0] = c[1] + 1.0 / 6.0 * c[7], eta[0] = c[3] + 1.0 / 6.0 * c[5];
    xi[1] = 4.0 * c[2] + 2.0 / 3.0 * c[8], eta[2] = 4.0 * c[6] + 2.0 / 3.0 * c[8];
    xi[2] = c[4], eta[1] = c[4];
    xi[3] = c[5], eta[3] = c[7];
    xi[6] = c[7], eta[4] = c[5];
    xi[7] = c[8], eta[5] = c[8];
}

INLINE void NAME(sum_slope_modes)(const half *xi, const half *eta, half *c) {
    const half zero = {0};
    c[0] = zero, c[1] = xi[0], c[3] = eta[0];
    c[2] = 4.0 * xi[1], c[6] = 4.0 * eta[2];
    c[4] = xi[2] + eta[1];
    c[5] = xi[3] + 1.0 / 6.0 * eta[0] + eta[4], c[7] = eta[3] + 1.0 / 6.0 * xi[0] + xi[6];
    c[8] = 2.0 / 3.0 * (xi[1] + eta[2]) + xi[7] + eta[5];
}

/* Modes of the strains of U_1 and U_2. */
INLINE void NAME(strain_modes)(half (*c)[9], half (*e)[MODES]) {
    half one[MODES], other[MODES];
    NAME(slope_modes)(c[0], e[0], one);
    NAME(slope_modes)(c[1], other, e[1]);
    for (int m = 0; m < 4; m++) e[2][m] = one[m] + other[m];
    e[2][4] = one[4], e[2][5] = one[5], e[2][6] = other[6], e[2][7] = other[7];
}

INLINE void NAME(sum_strain_modes)(half (*n)[MODES], half (*force)[9]) {
    NAME(sum_slope_modes)(n[0], n[2], force[0]);
    NAME(sum_slope_modes)(n[2], n[1], force[1]);
}

/* Add e_11 (axis 0) or e_22 (axis 1) at its tying points, along and across the axis, to its modes. */
INLINE void NAME(tie)(int axis, double scale, half (*f)[3], half *e) {
    const int one = axis ? 1 : 2, two = axis ? 4 : 6, along = axis ? 2 : 1, both = axis ? 5 : 7;
    const double *a = OF_SUM, *b = OF_DIFFERENCE;
    half sum[3], odd[3];
    for (int k = 0; k < 3; k++) sum[k] = f[1][k] + f[0][k], odd[k] = f[1][k] - f[0][k];
    const half sums = sum[2] + sum[0], odds = odd[2] + odd[0];
    e[0] += scale * a[MIDDLE] * sum[1] + scale * a[SIDES] * sums;
    e[one] += scale * a[STRAIGHT] * (sum[2] - sum[0]);
    e[two] += scale * a[BENT] * (sums - 2.0 * sum[1]);
    e[along] += scale * b[MIDDLE] * odd[1] + scale * b[SIDES] * odds;
    e[3] += scale * b[STRAIGHT] * (odd[2] - odd[0]);
    e[both] += scale * b[BENT] * (odds - 2.0 * odd[1]);
}

INLINE void NAME(untie)(int axis, double scale, const half *n, half (*f)[3]) {
    const int one = axis ? 1 : 2, two = axis ? 4 : 6, along = axis ? 2 : 1, both = axis ? 5 : 7;
    const double *a = OF_SUM, *b = OF_DIFFERENCE;
    const half straight = scale * a[STRAIGHT] * n[one], bent = scale * a[BENT] * n[two];
    const half turned = scale * b[STRAIGHT] * n[3], curved = scale * b[BENT] * n[both];
    const half side = scale * a[SIDES] * n[0] + bent, of_side = scale * b[SIDES] * n[along] + curved;
    const half sum[3] = {side - straight, scale * a[MIDDLE] * n[0] - 2.0 * bent, side + straight};
    const half odd[3] = {of_side - turned, scale * b[MIDDLE] * n[along] - 2.0 * curved, of_side + turned};
    for (int k = 0; k < 3; k++) f[1][k] = sum[k] + odd[k], f[0][k] = sum[k] - odd[k];
}

/* Slopes along an axis at the tying points of e_11 or e_22, and of e_12; indices along and across the axis. */
INLINE void NAME(tied_slopes)(int axis, const half *c, half (*at)[3], half (*corner)[2]) {
    const int along = axis ? 3 : 1, across = axis ? 1 : 3;
    half d[3][2];
    for (int b = 0; b < 3; b++) NAME(slopes)(2, ALONG, c[along + b * across], c[2 * along + b * across], d[b], 1);
    for (int i = 0; i < 2; i++) {
        NAME(values)(3, ACROSS, d[0][i], d[1][i], d[2][i], at[i], 1);
        NAME(values)(2, ALONG, d[0][i], d[1][i], d[2][i], corner[i], 1);
    }
}

INLINE void NAME(sum_tied_slopes)(int axis, half (*at)[3], half (*corner)[2], half *c) {
    const int along = axis ? 3 : 1, across = axis ? 1 : 3;
    half d[3][2] = {{{0}}};
    for (int i = 0; i < 2; i++) {
        NAME(sum_values)(3, ACROSS, at[i], 1, &d[0][i], &d[1][i], &d[2][i]);
        NAME(sum_values)(2, ALONG, corner[i], 1, &d[0][i], &d[1][i], &d[2][i]);
    }
    for (int b = 0; b < 3; b++) NAME(sum_slopes)(2, ALONG, d[b], 1, c + along + b * across, c + 2 * along + b * across);
}

/* Forces on the modes. */
INLINE void NAME(mode_stresses)(const half *C, half (*e)[MODES], half (*n)[MODES]) {
#pragma GCC unroll 8
    for (int m = 0; m < MODES; m++) {
        const int first = m < 4 || m > 5, second = m < 6;
        half strain[3], stress[3];
        if (first) strain[0] = NORMS[m] * e[0][m];
        if (second) strain[1] = NORMS[m] * e[1][m];
        strain[2] = NORMS[m] * e[2][m];
        NAME(stresses)(first, second, C, strain, stress);
        if (first) n[0][m] = stress[0];
        if (second) n[1][m] = stress[1];
        n[2][m] = stress[2];
    }
}

/* Add e_12 at its tying points (xi, eta) to its modes. */
INLINE void NAME(tie_corners)(double scale, half (*f)[2], half *e) {
    const half low = f[0][1] + f[0][0], high = f[1][1] + f[1][0];
    const half left = f[0][1] - f[0][0], right = f[1][1] - f[1][0];
    e[0] += scale * OF_CORNERS[0] * (high + low);
    e[1] += scale * OF_CORNERS[1] * (high - low);
    e[2] += scale * OF_CORNERS[1] * (right + left);
    e[3] += scale * OF_CORNERS[2] * (right - left);
}

INLINE void NAME(untie_corners)(double scale, const half *n, half (*f)[2]) {
    const half a = scale * OF_CORNERS[0] * n[0], x = scale * OF_CORNERS[1] * n[1];
    const half y = scale * OF_CORNERS[1] * n[2], both = scale * OF_CORNERS[2] * n[3];
    const half low = a - x, high = a + x, left = y - both, right = y + both;
    f[0][0] = low - left, f[0][1] = low + left, f[1][0] = high - right, f[1][1] = high + right;
}

/* Forces on the coefficients of a parallelogram. */
INLINE void NAME(of_modes)(int coupled, const double *data, half (*c)[9], half (*force)[9]) {
    half e[3][MODES], n[3][MODES], A[6], at[2][2][3], corner[2][2][2], f[2][3], g[2][2];
    NAME(strain_modes)(c, e);
    for (int axis = 0; axis < 2; axis++) {
        NAME(tied_slopes)(axis, c[2], at[axis], corner[axis]);
        for (int i = 0; i < 2; i++)
            for (int k = 0; k < 3; k++) f[i][k] = at[axis][i][k] * at[axis][i][k];
        NAME(tie)(axis, 0.125, f, e[axis]); /* w,a^2/2 from twice w,a */
    }
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++) g[i][k] = corner[0][i][k] * corner[1][k][i];
    NAME(tie_corners)(0.25, g, e[2]);

    for (int i = 0; i < 6; i++) A[i] = AT(4 + i);
    NAME(mode_stresses)(A, e, n);
    if (coupled) {
        half B[6], bent[3][MODES], stress[3][MODES];
        for (int i = 0; i < 6; i++) B[i] = AT(10 + i);
        NAME(mode_stresses)(B, e, stress);
        NAME(sum_strain_modes)(stress, force + 3);
        NAME(strain_modes)(c + 3, bent);
        NAME(mode_stresses)(B, bent, stress);
        for (int m = 0; m < MODES; m++) {
            if (m < 4 || m > 5) n[0][m] += stress[0][m];
            if (m < 6) n[1][m] += stress[1][m];
            n[2][m] += stress[2][m];
        }
    }
    NAME(sum_strain_modes)(n, force);
    memset(force[2], 0, sizeof force[2]);
    NAME(untie_corners)(0.25, n[2], g);
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++) {
            const half one = corner[0][i][k];
            corner[0][i][k] = g[i][k] * corner[1][k][i], corner[1][k][i] = g[i][k] * one;
        }
    for (int axis = 0; axis < 2; axis++) {
        NAME(untie)(axis, 0.25, n[axis], f);
        for (int i = 0; i < 2; i++)
            for (int k = 0; k < 3; k++) at[axis][i][k] *= f[i][k];
        NAME(sum_tied_slopes)(axis, at[axis], corner[axis], force[2]);
    }
}

/* Slopes of a biquadratic along xi and along eta at m points in eta by n in xi; the transpose adds. */
INLINE void NAME(gradient)(int m, const double *y, int n, const double *x, const half *c, half *along, half *across) {
    half d[3][3], v[3][3];
    for (int b = 0; b < 3; b++) {
        NAME(slopes)(n, x, c[3 * b + 1], c[3 * b + 2], d[b], 1);
        if (b) NAME(values)(n, x, c[3 * b], c[3 * b + 1], c[3 * b + 2], v[b], 1);
    }
    for (int l = 0; l < n; l++) {
        NAME(values)(m, y, d[0][l], d[1][l], d[2][l], along + l, n);
        NAME(slopes)(m, y, v[1][l], v[2][l], across + l, n);
    }
}

INLINE void NAME(sum_gradient)(int m, const double *y, int n, const double *x, const half *along, const half *across, half *c) {
    half d[3][3] = {{{0}}}, v[3][3] = {{{0}}};
    for (int l = 0; l < n; l++) {
        NAME(sum_values)(m, y, along + l, n, &d[0][l], &d[1][l], &d[2][l]);
        NAME(sum_slopes)(m, y, across + l, n, &v[1][l], &v[2][l]);
    }
    for (int b = 0; b < 3; b++) {
        NAME(sum_slopes)(n, x, d[b], 1, c + 3 * b + 1, c + 3 * b + 2);
        if (b) NAME(sum_values)(n, x, v[b], 1, c + 3 * b, c + 3 * b + 1, c + 3 * b + 2);
    }
}

/* Strains of U_1 and U_2 at the 9 points, with R there. */
INLINE void NAME(strains_of)(half (*R)[4], half (*c)[9], half (*e)[9]) {
    half a[2][9], b[2][9];
    for (int i = 0; i < 2; i++) NAME(gradient)(3, ACROSS, 3, ACROSS, c[i], a[i], b[i]);
    for (int k = 0; k < 9; k++) {
        const half *r = R[k];
        e[0][k] = r[0] * a[0][k] + r[1] * b[0][k];
        e[1][k] = r[2] * a[1][k] + r[3] * b[1][k];
        e[2][k] = r[0] * a[1][k] + r[1] * b[1][k] + (r[2] * a[0][k] + r[3] * b[0][k]);
    }
}

INLINE void NAME(sum_strains)(half (*R)[4], half (*n)[9], half (*force)[9]) {
    half a[2][9], b[2][9];
    for (int k = 0; k < 9; k++) {
        const half *r = R[k];
        a[0][k] = r[0] * n[0][k] + r[2] * n[2][k], b[0][k] = r[1] * n[0][k] + r[3] * n[2][k];
        a[1][k] = r[0] * n[2][k] + r[2] * n[1][k], b[1][k] = r[1] * n[2][k] + r[3] * n[1][k];
    }
    for (int i = 0; i < 2; i++) NAME(sum_gradient)(3, ACROSS, 3, ACROSS, a[i], b[i], force[i]);
}

/* Slopes along x_1 at the tying points of e_11, along x_2 at those of e_22, and along both at those of e_12. */
typedef struct {
    half one[6], two[6], both[2][4];
} NAME(Tied);

/* Tied quadratic strains at the 9 points, with R/2 of the tying points. */
INLINE void NAME(tied_strains)(const double *data, const half *c, NAME(Tied) *tied, half (*e)[9]) {
    half xi[6], eta[6], at[6], row[2][3];
    NAME(gradient)(3, ACROSS, 2, ALONG, c, xi, eta);
    for (int t = 0; t < 6; t++) {
        const half slope = AT(2 * t) * xi[t] + AT(2 * t + 1) * eta[t];
        tied->one[t] = slope, at[t] = 0.5 * slope * slope;
    }
    for (int k = 0; k < 3; k++) NAME(spread)(at[2 * k], at[2 * k + 1], e[0] + 3 * k, 1);
    NAME(gradient)(2, ALONG, 3, ACROSS, c, xi, eta);
    for (int t = 0; t < 6; t++) {
        const half slope = AT(12 + 2 * t) * xi[t] + AT(13 + 2 * t) * eta[t];
        tied->two[t] = slope, at[t] = 0.5 * slope * slope;
    }
    for (int l = 0; l < 3; l++) NAME(spread)(at[l], at[3 + l], e[1] + l, 3);
    NAME(gradient)(2, ALONG, 2, ALONG, c, xi, eta);
    for (int t = 0; t < 4; t++) {
        const half one = AT(24 + 4 * t) * xi[t] + AT(25 + 4 * t) * eta[t];
        const half two = AT(26 + 4 * t) * xi[t] + AT(27 + 4 * t) * eta[t];
        tied->both[0][t] = one, tied->both[1][t] = two, at[t] = one * two;
    }
    for (int k = 0; k < 2; k++) NAME(spread)(at[2 * k], at[2 * k + 1], row[k], 1);
    for (int l = 0; l < 3; l++) NAME(spread)(row[0][l], row[1][l], e[2] + l, 3);
}

INLINE void NAME(sum_tied_strains)(const double *data, const NAME(Tied) *tied, half (*n)[9], half *force) {
    half xi[6], eta[6], at[6], row[2][3];
    for (int k = 0; k < 3; k++) NAME(gather)(n[0] + 3 * k, 1, at + 2 * k, at + 2 * k + 1);
    for (int t = 0; t < 6; t++) {
        const half pull = tied->one[t] * at[t];
        xi[t] = AT(2 * t) * pull, eta[t] = AT(2 * t + 1) * pull;
    }
    NAME(sum_gradient)(3, ACROSS, 2, ALONG, xi, eta, force);
    for (int l = 0; l < 3; l++) NAME(gather)(n[1] + l, 3, at + l, at + 3 + l);
    for (int t = 0; t < 6; t++) {
        const half pull = tied->two[t] * at[t];
        xi[t] = AT(12 + 2 * t) * pull, eta[t] = AT(13 + 2 * t) * pull;
    }
    NAME(sum_gradient)(2, ALONG, 3, ACROSS, xi, eta, force);
    for (int l = 0; l < 3; l++) NAME(gather)(n[2] + l, 3, &row[0][l], &row[1][l]);
    for (int k = 0; k < 2; k++) NAME(gather)(row[k], 1, at + 2 * k, at + 2 * k + 1);
    for (int t = 0; t < 4; t++) {
        const half one = tied->both[1][t] * at[t], two = tied->both[0][t] * at[t];
        xi[t] = AT(24 + 4 * t) * one + AT(26 + 4 * t) * two;
        eta[t] = AT(25 + 4 * t) * one + AT(27 + 4 * t) * two;
    }
    NAME(sum_gradient)(2, ALONG, 2, ALONG, xi, eta, force);
}

/* Add the strains w/R of a curved plate to the strains at the 9 points. */
INLINE void NAME(add_curved)(const double *data, const half *c, half (*e)[9]) {
    half v[3][3], w[9];
    for (int b = 0; b < 3; b++) NAME(values)(3, ACROSS, c[3 * b], c[3 * b + 1], c[3 * b + 2], v[b], 1);
    for (int l = 0; l < 3; l++) NAME(values)(3, ACROSS, v[0][l], v[1][l], v[2][l], w + l, 3);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 9; k++) e[i][k] += AT(73 + i) * w[k];
}

INLINE void NAME(sum_curved)(const double *data, half (*n)[9], half *force) {
    half at[9], v[3][3] = {{{0}}};
    for (int k = 0; k < 9; k++) at[k] = AT(73) * n[0][k] + AT(74) * n[1][k] + AT(75) * n[2][k];
    for (int l = 0; l < 3; l++) NAME(sum_values)(3, ACROSS, at + l, 3, &v[0][l], &v[1][l], &v[2][l]);
    for (int b = 0; b < 3; b++) NAME(sum_values)(3, ACROSS, v[b], 1, force + 3 * b, force + 3 * b + 1, force + 3 * b + 2);
}

/* R and areas of the 9 points, from the coefficients of x and y. */
INLINE void NAME(frames)(const double *data, half (*R)[4], half *area) {
    const half xx = 4.0 * AT(0), xy = 4.0 * AT(1), yx = 4.0 * AT(2), yy = 4.0 * AT(3), zero = {0};
    half along[2][9], across[2][9], c[2][9]; /* slopes of x and y, doubled */
    for (int i = 0; i < 2; i++) {
        c[i][0] = zero;
        for (int k = 1; k < 9; k++) c[i][k] = AT(56 + 8 * i + k);
        NAME(gradient)(3, ACROSS, 3, ACROSS, c[i], along[i], across[i]);
    }
    for (int k = 0; k < 9; k++) {
        const half x_1 = along[0][k], y_1 = along[1][k], x_2 = across[0][k], y_2 = across[1][k];
        const half determinant = x_1 * y_2 - x_2 * y_1, share = 1.0 / determinant;
        R[k][0] = share * (xx * y_2 - xy * x_2), R[k][1] = share * (xy * x_1 - xx * y_1);
        R[k][2] = share * (yx * y_2 - yy * x_2), R[k][3] = share * (yy * x_1 - yx * y_1);
        area[k] = GAUSS[k / 3] * GAUSS[k % 3] * AT(56) * determinant;
    }
}

/* Forces on the coefficients of an element that is not a parallelogram, or belongs to a curved plate.  The
 * forces of w/R, which are linear in w, are stored in `lifting`. */
INLINE void NAME(of_points)(int coupled, int curved, const double *data, half (*c)[9], half (*force)[9], half *lifting) {
    half e[3][9], linear[3][9], bent[3][9], moment[3][9], R[9][4], areas[9], A[6], B[6];
    NAME(Tied) tied;
    NAME(tied_strains)(data + 16 * LANES, c[2], &tied, e);
    NAME(frames)(data, R, areas);
    NAME(strains_of)(R, c, linear);
    if (curved) NAME(add_curved)(data, c[2], linear);
    if (coupled) NAME(strains_of)(R, c + 3, bent);
    for (int i = 0; i < 6; i++) A[i] = AT(4 + i), B[i] = AT(10 + i);
    for (int k = 0; k < 9; k++) {
        const half area = areas[k];
        half strain[3], curvature[3], stress[3], other[3];
        for (int i = 0; i < 3; i++) strain[i] = area * (e[i][k] + linear[i][k]);
        NAME(stresses)(1, 1, A, strain, stress);
        if (coupled) {
            NAME(stresses)(1, 1, B, strain, other);
            for (int i = 0; i < 3; i++) moment[i][k] = other[i], curvature[i] = area * bent[i][k];
            NAME(stresses)(1, 1, B, curvature, other);
            for (int i = 0; i < 3; i++) stress[i] += other[i];
        }
        for (int i = 0; i < 3; i++) e[i][k] = stress[i];
    }
    memset(force, 0, sizeof(half) * 9 * (coupled ? 5 : 3));
    NAME(sum_strains)(R, e, force);
    if (coupled) NAME(sum_strains)(R, moment, force + 3);
    NAME(sum_tied_strains)(data + 16 * LANES, &tied, e, force[2]);
    if (curved) NAME(sum_curved)(data, e, lifting);
}

/* Components along the base vectors, from components in x and y. */
INLINE void NAME(covariant)(const double *data, half *a, half *b) {
    const half xx = AT(0), xy = AT(1), yx = AT(2), yy = AT(3);
    for (int i = 0; i < 9; i++) {
        const half x = a[i], y = b[i];
        a[i] = xx * x + xy * y, b[i] = yx * x + yy * y;
    }
}

INLINE void NAME(cartesian)(const double *data, half *a, half *b) {
    const half xx = AT(0), xy = AT(1), yx = AT(2), yy = AT(3);
    for (int i = 0; i < 9; i++) {
        const half one = a[i], two = b[i];
        a[i] = xx * one + yx * two, b[i] = xy * one + yy * two;
    }
}

/* Forces of the membrane of a block, and the work of its membrane forces on the quadratic strains. */
INLINE void NAME(stretch)(int coupled, int modes, int curved, const Plate *p, const Chunk *chunk, const Block *b, const double *u, double *f, half *work) {
    const int nd = coupled ? 5 : 3;
    const int32_t *grid = b->group->grid;
    lanes x[5][9] ALIGNED;
    for (int i = 0; i < 9; i++) NAME(take)(nd, p, chunk, b->place[grid[i]], u, x[0] + i, 9);
    for (int side = 0; side < 2; side++) {
        const double *data = b->membrane + 4 * side;
        half c[5][9] ALIGNED, force[5][9] ALIGNED, lifting[9] ALIGNED = {{0}};
        for (int dof = 0; dof < nd; dof++)
            for (int i = 0; i < 9; i++) c[dof][i] = HALF(x[dof][i]);
        NAME(covariant)(data, c[0], c[1]);
        if (coupled) NAME(covariant)(data, c[3], c[4]);
        for (int dof = 0; dof < nd; dof++) NAME(coefficients)(c[dof]);
        if (modes)
            NAME(of_modes)(coupled, data, c, force);
        else
            NAME(of_points)(coupled, curved, data, c, force, lifting);
        /* w f_w is twice this work, because eps_q is of second order. */
        half sum = 0.5 * c[2][1] * force[2][1];
        for (int i = 2; i < 9; i++) sum += 0.5 * c[2][i] * force[2][i];
        *work += sum;
        if (curved)
            for (int i = 0; i < 9; i++) force[2][i] += lifting[i];
        for (int dof = 0; dof < nd; dof++) NAME(nodal)(force[dof]);
        NAME(cartesian)(data, force[0], force[1]);
        if (coupled) NAME(cartesian)(data, force[3], force[4]);
        for (int dof = 0; dof < nd; dof++)
            for (int i = 0; i < 9; i++) HALF(x[dof][i]) = force[dof][i];
    }
    for (int i = 0; i < 9; i++) NAME(give)(nd, p, chunk, b->place[grid[i]], x[0] + i, 9, f);
}

TARGET void NAME(membrane)(const Plate *p, const Chunk *chunk, const Block *b, const double *u, double *f, half *work) {
    if (b->group->parallelograms && b->group->coupled)
        NAME(stretch)(1, 1, 0, p, chunk, b, u, f, work);
    else if (b->group->parallelograms)
        NAME(stretch)(0, 1, 0, p, chunk, b, u, f, work);
    else if (b->group->coupled)
        NAME(stretch)(1, 0, 0, p, chunk, b, u, f, work);
    else
        NAME(stretch)(0, 0, 0, p, chunk, b, u, f, work);
}

TARGET void NAME(curved_membrane)(const Plate *p, const Chunk *chunk, const Block *b, const double *u, double *f, half *work) {
    if (b->group->coupled)
        NAME(stretch)(1, 0, 1, p, chunk, b, u, f, work);
    else
        NAME(stretch)(0, 0, 1, p, chunk, b, u, f, work);
}

#undef AT
