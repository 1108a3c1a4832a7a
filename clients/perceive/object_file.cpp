#include "clients/perceive/object_file.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <system_error>

#include "clients/geometry/mesh_file.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/base/utf8.hpp"

namespace dtact::perceive {

std::shared_ptr<const ObjectModel> load_object(const std::filesystem::path& file,
                                               const std::string& unit) {
  std::error_code unknown;
  const std::uintmax_t size = std::filesystem::file_size(file, unknown);
  if (!unknown) check_mesh_size(size, file.string());
  const Mesh mesh = parse_mesh(base::read_file(file, kMaxMeshBytes), file.string());
  try {
    return std::make_shared<const ObjectModel>(
        make_object(mesh, unit == "m" ? 1 : 1e-3, base::as_utf8(file.stem().string())));
  } catch (const std::runtime_error& e) {
    throw std::runtime_error(
        fmt::format("{}, read in {} (--object-unit): {}", file.string(), unit, e.what()));
  }
}

}  // namespace dtact::perceive
