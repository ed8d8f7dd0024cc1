#pragma once

namespace fringe_fusion::diagnosis {

/// Probability that a chi-square variable of `dof` degrees of freedom is at most x.
/// Ref: Abramowitz & Stegun, "Handbook of Mathematical Functions", 1964, eq. 6.5.29 (series).
[[nodiscard]] double ChiSquareCdf(double x, double dof);

/// Mean of a chi-square variable per degree of freedom given that it is at most x.
[[nodiscard]] double TruncatedChiSquareMean(double x, double dof);

/// The x that a standard normal z stands for: Wilson and Hilferty's cube.
/// Ref: Wilson & Hilferty, "The distribution of chi-square", PNAS 17, 1931.
[[nodiscard]] double ChiSquareLimit(double z, double dof);

}  // namespace fringe_fusion::diagnosis
