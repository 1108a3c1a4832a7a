#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/tiles.hpp"

namespace dtact::recon {

/// A depth map's means over square cells of about 0.66 mm, at most 64 in each direction. Pixels at
/// the right and at the bottom that fill no cell belong to none, but cut_off() counts them.
class CellMap {
 public:
  /// Throws std::invalid_argument for a map smaller than one cell.
  CellMap(int width, int height, double mm_per_px);

  /// `depth_um`: row-major. Outside `tiles` it is taken for 0. Does not allocate.
  void read(std::span<const std::int16_t> depth_um, const TileRows& tiles) noexcept;
  /// The same of all tiles.
  void read(std::span<const std::int16_t> depth_um);

  /// Something presses a cell at the map's edge or beside a cell that is not known, or the pixels
  /// that fill no cell.
  [[nodiscard]] bool cut_off() const noexcept;

  [[nodiscard]] int columns() const noexcept { return columns_; }
  [[nodiscard]] int rows() const noexcept { return rows_; }
  [[nodiscard]] double cell_mm() const noexcept { return cell_mm_; }
  /// Row-major, mm; NaN where most pixels are untrusted.
  [[nodiscard]] std::span<const float> mm() const noexcept { return mm_; }

 private:
  [[nodiscard]] int row_step() const noexcept;     ///< From a row that is read to the next.
  [[nodiscard]] int read_pixels() const noexcept;  ///< Of a cell.
  /// Whether of the pixels that fill no cell at least a quarter of a cell's number are pressed.
  [[nodiscard]] bool rest_is_pressed(std::span<const std::int16_t> depth_um,
                                     const TileRows& tiles) const noexcept;

  TileGrid grid_;
  int cell_px_;
  double cell_mm_;
  int columns_;
  int rows_;
  std::vector<float> mm_;
  std::vector<std::int32_t> sums_;       // of a row of cells, by the map's columns
  std::vector<std::int32_t> untrusted_;  // pixels of them
  bool rest_pressed_ = false;
};

/// The response of a linear-elastic, incompressible gel bonded to a stiff block to an indentation.
/// A pressure p gives the indentation û(k) = C(k) p̂(k), for Young's modulus E and thickness h
///
///     C(k) = 3/(2 E k) · (sinh 2kh − 2kh) / (cosh 2kh + 1 + 2 (kh)²).
///
/// By reciprocity the pressure p that makes u, zero outside a region, has the force
/// ∫ p dA = ∫ q u dA, where q is the pressure that indents the whole region by 1. The region may be
/// wider than the contact: all points pressed deeper than 0.04 mm. Scattering blurs the indentation
/// in depth maps; so the C(k) for q is blurred with the same Gaussian of 0.2 h.
class GelResponse {
 public:
  /// For maps of the same shape as `shape`. Takes a few milliseconds.
  GelResponse(double thickness_mm, const CellMap& shape);

  /// For a modulus of 1 MPa.
  struct Answer {
    double mm2 = 0;  ///< ∫ q u dA, N/MPa.
    double mm = 0;   ///< ∫ q dA, the force for each millimetre more, N/MPa/mm.
  };
  /// Does not allocate.
  [[nodiscard]] Answer answer(const CellMap& map) noexcept;

 private:
  /// Cells so coarse that a contact has at most kMaxCells of them.
  struct Level {
    int columns = 0;
    int rows = 0;
    double cell_mm = 0;
    std::vector<float> green;  ///< Mean indentation a column and a row away from a pressed cell.
    std::vector<float> mm;
  };
  struct Cell {
    int column = 0;
    int row = 0;
    float mm = 0;
  };

  [[nodiscard]] bool collect(const Level& level) noexcept;
  void solve(const Level& level) noexcept;

  std::vector<Level> levels_;  // each half as fine as the one before
  std::vector<Cell> cells_;    // pressed
  std::vector<float> matrix_;
  std::vector<float> q_, residual_, direction_, product_;
};

}  // namespace dtact::recon
