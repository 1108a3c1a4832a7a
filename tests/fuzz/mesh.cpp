// An object's file: STL or PLY. An accepted one has faces with existing corners, or a normal for
// each point, and can be sampled or is refused with a message.
#include <stdexcept>

#include "clients/perceive/pose/object_model.hpp"
#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  try {
    const perceive::Mesh mesh =
        perceive::parse_mesh({reinterpret_cast<const char*>(data), size}, "object");
    fuzz::require(!mesh.triangles.empty() || mesh.normals.size() == mesh.points.size(),
                  "there are faces, or a normal for each point");
    for (const auto& triangle : mesh.triangles) {
      for (const std::uint32_t corner : triangle) {
        fuzz::require(corner < mesh.points.size(), "a face's corners are points");
      }
    }
    const perceive::ObjectModel object = perceive::make_object(mesh, 1e-3, "object");
    fuzz::require(object.surfels.size() <= perceive::kMaxSurfels, "surfels are limited");
  } catch (const std::runtime_error& e) {
    fuzz::require_sentence(e.what());
  }
  return 0;
}
