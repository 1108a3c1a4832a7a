#pragma once

#include <functional>
#include <vector>

namespace dtact::accuracy {

/// Smallest value of `cost` near `start` by the simplex of Nelder and Mead (The Computer Journal 7,
/// 1965) with their coefficients. The first simplex is `start` and, for each parameter, `start`
/// with that parameter changed by `step`. Stops after `evaluations` or when the simplex's costs
/// differ by less than `tolerance`.
[[nodiscard]] std::vector<double> nelder_mead(
    const std::function<double(const std::vector<double>&)>& cost, const std::vector<double>& start,
    const std::vector<double>& step, int evaluations, double tolerance);

}  // namespace dtact::accuracy
