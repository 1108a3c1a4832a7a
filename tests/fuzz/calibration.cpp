// A calibration's two files, calibration.toml and, after a line "#PNG", reference.png. "@SHA@"
// stands for the digest of the PNG. An accepted one can be written again and reconstructs a frame.
#include "daemon/calibration/calibration.hpp"

#include <fmt/format.h>

#include <memory>
#include <stdexcept>

#include "daemon/calibration/text.hpp"
#include "daemon/recon/model.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/tile_readers.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/png_checksums.hpp"

namespace dtact::fuzz {
namespace {

void reconstruct(const std::shared_ptr<const recon::Model>& model) {
  recon::Reconstructor reconstructor(model);
  const auto& table = model->rectify;
  const auto pixels =
      static_cast<std::size_t>(table.frame_width) * static_cast<std::size_t>(table.frame_height);
  std::vector<std::uint8_t> luma(pixels + recon::kLumaPadding);
  for (std::size_t i = 0; i < pixels; ++i) luma[i] = static_cast<std::uint8_t>(i * 37);
  std::vector<std::int16_t> depth(static_cast<std::size_t>(table.width) *
                                  static_cast<std::size_t>(table.height));
  reconstructor.run(luma.data(), table.frame_width, depth);
  const recon::CellLattice lattice(table);
  const recon::TileReaders readers(lattice, table, reconstructor.radius());
  recon::TileRows tiles(static_cast<std::size_t>(readers.grid().rows()));
  std::vector<std::int32_t> active(lattice.at(0, lattice.rows()));
  for (std::size_t i = 0; i < active.size(); i += 5) active[i] = -1;
  readers.mark(active, tiles);
  recon::DrawnTiles drawn;
  reconstructor.run_active(luma.data(), table.frame_width, tiles, depth, drawn);
}

void use(const calibration::Calibration& calibration) {
  const auto again = [](const calibration::Files& files) {
    return calibration::format(calibration::parse(files.toml, files.reference_png, "again"));
  };
  const calibration::Files written = again(calibration::format(calibration));
  const calibration::Files rewritten = again(written);
  require(rewritten.toml == written.toml && rewritten.reference_png == written.reference_png,
          "a calibration that is read can be written and stays the same");
  // Larger maps add nothing and take long.
  if (calibration.model->reference_q8.size() > 65536) return;
  reconstruct(calibration.model);
  if (calibration.model->rectify.width < 4 || calibration.model->rectify.height < 4) return;
  reconstruct(std::make_shared<const recon::Model>(recon::decimate(*calibration.model, 4)));
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  const auto parts = fuzz::split({reinterpret_cast<const char*>(data), size}, "\n#PNG\n", 2);
  const std::string png = parts.size() == 2 ? fuzz::with_right_checksums(parts[1]) : std::string();
  std::string toml = parts[0];
  if (const std::size_t at = toml.find("@SHA@"); at != std::string::npos) {
    toml.replace(at, 5, calibration::sha256_hex(png));
  }
  try {
    fuzz::use(calibration::parse(toml, png, "seed"));
  } catch (const std::runtime_error& e) {
    fuzz::require_sentence(e.what());
  }
  return 0;
}
