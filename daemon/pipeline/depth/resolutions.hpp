#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/tile_readers.hpp"

namespace dtact::pipeline {

/// What turns frames into depth at one resolution.
struct Resolution {
  recon::Reconstructor reconstructor;
  recon::TileReaders readers;
  recon::TileRows tiles;  ///< Of the last frame.

  [[nodiscard]] int decimation() const noexcept { return reconstructor.model().rectify.decimation; }
};

/// A calibration's model at each resolution that may be asked for. Made on the network's side, used
/// on the capture thread.
class Resolutions {
 public:
  Resolutions(const std::shared_ptr<const recon::Model>& model, const recon::CellLattice& lattice,
              const ReconstructionRules& rules);

  /// The one that works on the next frame.
  [[nodiscard]] Resolution& in_use() noexcept { return all_[in_use_]; }
  /// From the next frame on the map has 1/`decimation` of the resolution, where there is one such.
  void use_decimation(int decimation) noexcept;

  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;
  /// The light is the reference's times `factor`.
  void set_light(double factor) noexcept;

  /// What the list is uncertain by at an indentation, micrometres: as the calibration says, else
  /// kUnstatedListUm or, of a published method, kUnstatedPublishedUm.
  [[nodiscard]] double list_um(double depth_mm) const noexcept;
  /// What a light that differs from the reference's by `share` adds to or takes off every
  /// indentation, micrometres.
  [[nodiscard]] double light_um(double share) const noexcept;

 private:
  std::shared_ptr<const recon::Model> model_;
  double mean_grey_;             // of the calibration's reference
  std::vector<Resolution> all_;  // the coarser after the finer
  std::size_t in_use_ = 0;
};

}  // namespace dtact::pipeline
