#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "daemon/pipeline/depth_frame.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/pipeline/reference/reference_tracker.hpp"
#include "daemon/recon/force.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/tile_readers.hpp"
#include "daemon/recon/upsampler.hpp"

namespace dtact::pipeline {

/// One way to turn frames into depth: a resolution, plain or sharpened. Sharpened maps are
/// made at recon::kSharpenedAt and interpolated to the requested resolution.
struct Resolution {
  recon::Reconstructor reconstructor;
  recon::TileReaders readers;
  recon::TileRows tiles;  ///< written by the last frame

  /// Reconstruction that is interpolated to a finer map.
  struct Coarse {
    recon::Upsampler upsampler;
    std::vector<std::int16_t> depth_um;
    recon::DrawnTiles drawn;
  };
  std::optional<Coarse> coarse;
  std::optional<recon::ForceMeter> force;  ///< set if the calibration has a force

  /// The reconstruction's decimation; the map may be finer.
  [[nodiscard]] int decimation() const noexcept {
    const recon::Model& model = reconstructor.model();
    return model.frame_scale * model.rectify.decimation;
  }
  [[nodiscard]] int steps() const noexcept { return reconstructor.sharpen_steps(); }
};

/// Gives a contact its force. `depth_um`: what `resolution` made; `beyond`: of it part is deeper
/// than the calibration covers.
void add_force(Resolution& resolution, std::span<const std::int16_t> depth_um, bool beyond,
               double uncertainty_um, ContactSummary& contact) noexcept;

/// Size and pixel scale of a map.
struct MapShape {
  int width = 0;
  int height = 0;
  int decimation = 1;
  double mm_per_px = 0;
};

/// A calibration's model at each resolution that may be requested, ordered from the cheapest to
/// the most accurate. Made on the network thread, used on the capture thread.
class Resolutions {
 public:
  static constexpr std::size_t kMaxResolutions = 3;

  /// Of scaled frames (recon::Model::frame_scale) no map is finer than they are, whatever the rules
  /// ask for. Throws std::invalid_argument, saying what to do, where the rules ask for steps of
  /// sharpening that the model has no LUT for.
  Resolutions(const std::shared_ptr<const recon::Model>& model, const recon::CellLattice& lattice,
              const ReconstructionRules& rules);

  /// ReconstructionRules::max_error_um.
  [[nodiscard]] double max_error_um() const noexcept { return max_error_um_; }
  /// The resolution for the next frame.
  [[nodiscard]] Resolution& in_use() noexcept { return all_[in_use_]; }
  [[nodiscard]] std::size_t resolution_index() const noexcept { return in_use_; }
  [[nodiscard]] std::span<const Resolution> resolutions() const noexcept { return all_; }
  void use(std::size_t resolution_index) noexcept { in_use_ = resolution_index; }

  /// The map at the resolution in use.
  [[nodiscard]] MapShape shape() const noexcept;

  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;
  /// The light is the reference's times `factor`.
  void set_light(double factor) noexcept;

  /// Uncertainty of the LUT for this number of steps at an indentation, micrometres: the
  /// calibration's value, else kDefaultLutUncertaintyUm or, for a published method,
  /// kDefaultPublishedUncertaintyUm.
  [[nodiscard]] double lut_um(double depth_mm, int steps) const noexcept;
  /// The same with what the reference image is trusted to, in squares: of a contact that is
  /// `deepest_mm` deep, half of which is about its mean.
  [[nodiscard]] double contact_um(double deepest_mm, int steps, const Trust& trust) const noexcept;

 private:
  /// Error of every indentation, micrometres, under a light that differs from the reference's by
  /// `share`.
  [[nodiscard]] double light_um(double share) const noexcept;
  void add(const recon::CellLattice& lattice, int decimation, int steps, int map_decimation);

  std::shared_ptr<const recon::Model> model_;
  double max_error_um_;
  double mean_grey_;             // of the calibration's reference, over the mapped pixels
  std::vector<Resolution> all_;  // from the cheapest to the most accurate
  std::size_t in_use_ = 0;
};

}  // namespace dtact::pipeline
