#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "clients/perceive/recognition/recogniser.hpp"

namespace dtact::perceive {

/// An object that a user has taught by presses.
struct TaughtObject {
  std::string name;
  std::vector<std::vector<float>> features;  ///< The network's, of each press.
  /// Greatest distance() from its nearest press at which a press is still of this object.
  double radius = 0;
};

/// 1 minus the cosine between two features: 0 … 2.
[[nodiscard]] double distance(const std::vector<float>& a, const std::vector<float>& b);
/// From the features' nearest press of the object, which may leave out press `without`.
[[nodiscard]] double nearest(const TaughtObject& object, const std::vector<float>& features,
                             std::size_t without = SIZE_MAX);

/// Its radius is that of its presses, each left out once.
[[nodiscard]] TaughtObject teach(Network& network, std::string name,
                                 std::span<const TouchMap> presses);

/// A folder of taught objects: NAME.png holds an object's presses one below the other, 96 × 96
/// pixels each, 16-bit grey, micrometres of depth plus 32768. A network with other weights
/// needs no new presses: features are computed when the folder is read. Hidden files are skipped.
[[nodiscard]] std::vector<std::string> taught_names(const std::filesystem::path& folder);
[[nodiscard]] std::filesystem::path file_of(const std::filesystem::path& folder,
                                            const std::string& name);
/// Throws std::runtime_error naming the file and the fix.
[[nodiscard]] std::vector<TouchMap> read_presses(const std::filesystem::path& folder,
                                                 const std::string& name);
/// Makes the folder, if need be. Throws std::runtime_error with the fix where write_presses() would
/// fail.
void prepare_to_write(const std::filesystem::path& folder, const std::string& name);
/// Replaces the object's presses as a whole. Throws std::system_error naming the file.
void write_presses(const std::filesystem::path& folder, const std::string& name,
                   std::span<const TouchMap> presses);
/// Throws std::runtime_error for a name that is none: one to 60 letters, digits, spaces, and any of
/// . _ - not at its beginning.
void check_name(const std::string& name);

struct TaughtFolder {
  std::vector<TaughtObject> objects;
  std::vector<std::string> damaged;  ///< What read_presses() says of each of the others.
};
[[nodiscard]] TaughtFolder load_taught(Network& network, const std::filesystem::path& folder);

}  // namespace dtact::perceive
