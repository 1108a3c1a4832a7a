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

/// One way to turn frames into depth: at a resolution, plain or sharpened. Sharpened levels are
/// made at recon::kSharpenedAt and interpolated to the map that was asked for.
struct Resolution {
  recon::Reconstructor reconstructor;
  recon::TileReaders readers;
  recon::TileRows tiles;  ///< Of the last frame.

  /// Of a map that is finer than the reconstruction: what is interpolated.
  struct Coarse {
    recon::Upsampler upsampler;
    std::vector<std::int16_t> depth_um;
    recon::DrawnTiles drawn;
  };
  std::optional<Coarse> coarse;
  std::optional<recon::ForceMeter> force;  ///< Where the calibration has a force.

  /// The reconstruction's; the map's may be finer.
  [[nodiscard]] int decimation() const noexcept { return reconstructor.model().rectify.decimation; }
  [[nodiscard]] int steps() const noexcept { return reconstructor.sharpen_steps(); }
};

/// Gives a contact its force. `depth_um`: what `resolution` made; `beyond`: of it part is deeper
/// than the calibration covers.
void add_force(Resolution& resolution, std::span<const std::int16_t> depth_um, bool beyond,
               double uncertainty_um, ContactSummary& contact) noexcept;

/// What a map is and where it goes.
struct MapShape {
  int width = 0;
  int height = 0;
  int decimation = 1;
  double mm_per_px = 0;
};

/// A calibration's model in each way that may be asked for: the rungs of a ladder, from the
/// cheapest to the most accurate. Made on the network's side, used on the capture thread.
class Resolutions {
 public:
  static constexpr std::size_t kMaxResolutions = 3;

  /// Throws std::invalid_argument, saying what to do, where the rules ask for steps of sharpening
  /// that the model has no LUT for.
  Resolutions(const std::shared_ptr<const recon::Model>& model, const recon::CellLattice& lattice,
              const ReconstructionRules& rules);

  /// ReconstructionRules::max_error_um.
  [[nodiscard]] double max_error_um() const noexcept { return max_error_um_; }
  /// The one that works on the next frame.
  [[nodiscard]] Resolution& in_use() noexcept { return all_[in_use_]; }
  [[nodiscard]] std::size_t resolution_index() const noexcept { return in_use_; }
  [[nodiscard]] std::span<const Resolution> resolutions() const noexcept { return all_; }
  void use(std::size_t resolution_index) noexcept { in_use_ = resolution_index; }
  /// The rung of that resolution and so many steps, if there is one.
  [[nodiscard]] std::optional<std::size_t> find(int decimation, int steps) const noexcept;

  /// The map that the rung in use gives.
  [[nodiscard]] MapShape shape() const noexcept;

  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;
  /// The light is the reference's times `factor`.
  void set_light(double factor) noexcept;

  /// What the LUT for so many steps is uncertain by at an indentation, micrometres: as the
  /// calibration says, else kDefaultLutUncertaintyUm or, of a published method,
  /// kDefaultPublishedUncertaintyUm.
  [[nodiscard]] double lut_um(double depth_mm, int steps) const noexcept;
  /// The same with what the reference image is trusted to, in squares: of a contact that is
  /// `deepest_mm` deep, half of which is about its mean.
  [[nodiscard]] double contact_um(double deepest_mm, int steps, const Trust& trust) const noexcept;

 private:
  /// What a light that differs from the reference's by `share` adds to or takes off every
  /// indentation, micrometres.
  [[nodiscard]] double light_um(double share) const noexcept;
  void add(const recon::CellLattice& lattice, int decimation, int steps, int map_decimation);

  std::shared_ptr<const recon::Model> model_;
  double max_error_um_;
  double mean_grey_;             // of the calibration's reference where depth is made of it
  std::vector<Resolution> all_;  // the cheaper before the more accurate
  std::size_t in_use_ = 0;
};

}  // namespace dtact::pipeline
