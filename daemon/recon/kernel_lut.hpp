#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/recon/kernels.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::recon {

/// A model's LUT in the kernels' form. Method::lut: straight lines between knots a grey level
/// apart wherever the values agree (kKnotsWithinUm), since a processor may hold the knots in
/// registers and read no table. Everything beyond the covered range gives kUntrusted.
class KernelLut {
 public:
  /// Straight lines stand for a LUT that they follow within this, root mean square over the
  /// covered range, micrometres: less than the last place of a depth, while LUTs are right within
  /// ten or more. Other LUTs are looked up entry by entry.
  static constexpr double kKnotsWithinUm = 0.6;

  KernelLut(const DepthLut& lut, Method method);

  /// Refers to this table.
  [[nodiscard]] kernels::LutView view() const noexcept;

 private:
  int first_q6_;
  int covered_q6_;
  /// The entries, and kUntrusted once more for what vector kernels mark.
  std::vector<std::int16_t> um_;
  std::unique_ptr<const kernels::Knots> knots_;
};

}  // namespace dtact::recon
