/* Assumed transverse shear strains of biquadratic elements, by sum factorization; included by plate.h once for
 * each instruction set.
 *
 ** The covariant strain e_a = w,a - theta_x x,a - theta_y y,a of an axis, xi or eta, is evaluated at tying
 * points: two along the axis, at +-1/sqrt(3), by three across the axis, at 0 and +-sqrt(3/5).  Between them the
 * strain is linear along the axis.  The points across the axis are points of the 3 x 3 quadrature.
 *
 * The coefficients of plate.h make slopes and strains twice as large.  Arrays over tying points are (along,
 * across), arrays over points of quadrature (xi, eta).  Four elements are computed at a time.  Each function is
 * followed by its transpose.
 */

/* Values of a linear function at -sqrt(3/5), 0, sqrt(3/5) from its values at +-1/sqrt(3). */
INLINE void NAME(spread)(half low, half high, half *v, int step) {
    const half middle = 0.5 * (low + high), odd = SPREAD * (high - low);
    v[0] = middle - odd, v[step] = middle, v[2 * step] = middle + odd;
}

INLINE void NAME(gather)(const half *v, int step, half *low, half *high) {
    const half middle = 0.5 * (v[0] + v[step] + v[2 * step]), odd = SPREAD * (v[2 * step] - v[0]);
    *low = middle - odd, *high = middle + odd;
}

/* Values of a biquadratic at the tying points of an axis, or slopes along the axis; the transpose adds. */
INLINE void NAME(at_tying)(int axis, int slope, const half *c, half (*at)[3]) {
    const int along = axis ? 3 : 1, across = axis ? 1 : 3;
    half line[3][2];
    for (int b = 0; b < 3; b++, c += across)
        if (slope)
            NAME(slopes)(2, ALONG, c[along], c[2 * along], line[b], 1);
        else
            NAME(values)(2, ALONG, c[0], c[along], c[2 * along], line[b], 1);
    for (int i = 0; i < 2; i++) NAME(values)(3, ACROSS, line[0][i], line[1][i], line[2][i], at[i], 1);
}

INLINE void NAME(sum_at_tying)(int axis, int slope, half (*at)[3], half *c) {
    const int along = axis ? 3 : 1, across = axis ? 1 : 3;
    half line[3][2] = {{{0}}};
    for (int i = 0; i < 2; i++) NAME(sum_values)(3, ACROSS, at[i], 1, &line[0][i], &line[1][i], &line[2][i]);
    for (int b = 0; b < 3; b++, c += across)
        if (slope)
            NAME(sum_slopes)(2, ALONG, line[b], 1, c + along, c + 2 * along);
        else
            NAME(sum_values)(2, ALONG, line[b], 1, c, c + along, c + 2 * along);
}

/* Strains of an axis at the points, from the coefficients of w, theta_x, theta_y, x and y.  The transpose adds
 * forces on the first three.  `mapping` is twice the slopes of x and y at the tying points. */
INLINE void NAME(assume)(int axis, half (*c)[9], half (*mapping)[2][3], half (*e)[3]) {
    half w[2][3], rotation[2][2][3];
    NAME(at_tying)(axis, 1, c[0], w);
    for (int i = 0; i < 2; i++) {
        NAME(at_tying)(axis, 0, c[1 + i], rotation[i]);
        NAME(at_tying)(axis, 1, c[3 + i], mapping[i]);
    }
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 2; i++) w[i][k] -= mapping[0][i][k] * rotation[0][i][k] + mapping[1][i][k] * rotation[1][i][k];
        NAME(spread)(w[0][k], w[1][k], axis ? e[k] : e[0] + k, axis ? 1 : 3);
    }
}

INLINE void NAME(sum_assumed)(int axis, half (*e)[3], half (*mapping)[2][3], half (*force)[9]) {
    half w[2][3], rotation[2][2][3];
    for (int k = 0; k < 3; k++) {
        NAME(gather)(axis ? e[k] : e[0] + k, axis ? 1 : 3, &w[0][k], &w[1][k]);
        for (int i = 0; i < 2; i++)
            for (int along = 0; along < 2; along++) rotation[i][along][k] = -mapping[i][along][k] * w[along][k];
    }
    NAME(sum_at_tying)(axis, 1, w, force[0]);
    for (int i = 0; i < 2; i++) NAME(sum_at_tying)(axis, 0, rotation[i], force[1 + i]);
}
