#pragma once

#include <span>
#include <stdexcept>
#include <vector>

#include "daemon/recon/lens.hpp"

namespace dtact::ctl {

/// A point of the surface and its pixel in the camera's image.
struct Mark {
  recon::Point mm;
  recon::Point px;
};

/// Free parameters of the lens.
enum class LensModel {
  affine,      ///< 6
  projective,  ///< 8
  radial1,     ///< 11: centre of distortion and k₁
  radial2,     ///< 12
  radial3,     ///< 13
  radial4,     ///< 14
};
[[nodiscard]] int parameters(LensModel model);

/// There are fewer marks than parameters, they lie on a line, or the solver fails.
class FitFailed : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The lens that minimises the squared distances in pixels (by Ceres, from the best affine map
/// through the smaller models). Throws FitFailed.
[[nodiscard]] recon::Lens fit_lens(std::span<const Mark> marks, LensModel model);

/// Distances in millimetres on the surface between each mark's nominal position and the lens's
/// position for its pixel; from the lens's local inverse, so accurate for small ones.
[[nodiscard]] std::vector<recon::Point> residuals_mm(const recon::Lens& lens,
                                                     std::span<const Mark> marks);

/// Root mean square of the distances.
[[nodiscard]] double rms(std::span<const recon::Point> residuals);

/// Each mark's residual with a lens fitted to all others.
[[nodiscard]] std::vector<recon::Point> leave_one_out(std::span<const Mark> marks, LensModel model);

/// A lens, the model that cross-validation chose, and its errors.
struct ChosenLens {
  recon::Lens lens;
  LensModel model = LensModel::affine;
  std::vector<recon::Point> in_sample;       ///< mm, of each mark
  std::vector<recon::Point> left_out;        ///< mm, of each mark with the lens of the others
  std::vector<double> left_out_rms_of_each;  ///< mm, by LensModel; of those that were tried
};

/// The smallest model that no larger one improves on: a larger one must lower the mean squared
/// left-out residual clearly. A model on which the solver fails ends the search.
[[nodiscard]] ChosenLens choose_lens(std::span<const Mark> marks);

/// Whether the mean of `squares` is below that of `others`, of the same samples, by more than
/// two standard errors of the difference.
[[nodiscard]] bool clearly_lower(std::span<const double> squares, std::span<const double> others);

/// Turns the millimetres' axes so that the lens's Jacobian at the origin has no rotation (its polar
/// decomposition): the rectified image is as upright as the camera's for any turn of the board.
void level(recon::Lens& lens, std::span<Mark> marks);

}  // namespace dtact::ctl
