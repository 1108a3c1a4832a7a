#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "daemon/recon/lens.hpp"

namespace dtact::ctl {

/// A pin's neighbourhood in the plane of the surface, and the fit to it: a third-order surface with
/// Gaussian weights of a fifth of the pitch (see pins.hpp).
class PinFit {
 public:
  /// `image`: darkening, outlives this.
  PinFit(const cv::Mat1f& image, double pitch_mm, double mm_per_px);

  /// Noise of the height below for the noise of one pixel.
  [[nodiscard]] double height_noise(double pixel_noise) const;

  struct Peak {
    recon::Point mm;
    /// Fall of the fitted paraboloid one weight's sigma around the peak, twice its mean, levels.
    double height = 0;
  };

  /// The peak within `reach_mm` of `start`, or none.
  [[nodiscard]] std::optional<Peak> find(const recon::Lens& lens, recon::Point start,
                                         double reach_mm) const;

 private:
  [[nodiscard]] std::optional<Eigen::VectorXd> fit_at(const recon::Lens& lens,
                                                      recon::Point at) const;
  [[nodiscard]] double bilinear(recon::Point px) const;

  const cv::Mat1f& image_;
  double sigma_;
  std::vector<recon::Point> points_;
  Eigen::VectorXd weights_;
  Eigen::MatrixXd solver_;
};

}  // namespace dtact::ctl
