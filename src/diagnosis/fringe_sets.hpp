#pragma once

#include <functional>
#include <vector>

namespace fringe_fusion::diagnosis {

/// Loss of modulation at a number of fringes.
using TransferOf = std::function<double(double fringes)>;

/// Codes of `count` frequencies that end with `finest` fringes and are worth comparing: nested from
/// one fringe, and jointly unwrapped ones that no other beats both in the information on the
/// coordinate, sum of (f transfer(f))^2, and in the margin against a wrong fringe order.
/// @param finest at least 3. @param count 2 .. 4; jointly unwrapped up to 3.
/// Ref: science sections 2.3, 2.4.
[[nodiscard]] std::vector<std::vector<double>> FringeSets(int finest, int count,
                                                          const TransferOf& transfer);

}  // namespace fringe_fusion::diagnosis
