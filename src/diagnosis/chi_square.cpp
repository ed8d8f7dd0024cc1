#include "chi_square.hpp"

#include <cmath>

namespace fringe_fusion::diagnosis {

double ChiSquareCdf(double x, double dof) {
  if (!(x > 0.0) || !(dof > 0.0)) return 0.0;
  const double a = 0.5 * dof;
  const double half = 0.5 * x;
  // Far in the tail the series needs many terms to say 1.
  if (half > a + 40.0 + 12.0 * std::sqrt(a)) return 1.0;
  double term = 1.0 / a;
  double sum = term;
  for (int n = 1; n < 10000 && term > 1e-16 * sum; ++n) {
    term *= half / (a + n);
    sum += term;
  }
  return std::exp(a * std::log(half) - half - std::lgamma(a)) * sum;
}

double TruncatedChiSquareMean(double x, double dof) {
  // The density times its argument is dof times the density of dof + 2.
  return ChiSquareCdf(x, dof + 2.0) / ChiSquareCdf(x, dof);
}

double ChiSquareLimit(double z, double dof) {
  const double share = 2.0 / (9.0 * dof);
  const double root = 1.0 - share + z * std::sqrt(share);
  return dof * root * root * root;
}

}  // namespace fringe_fusion::diagnosis
