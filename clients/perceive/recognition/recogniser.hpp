#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <opencv2/dnn.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/perceive/recognition/touch_map.hpp"

namespace dtact::perceive {

/// Names of the classes, in the order of the network's outputs.
inline constexpr std::array<std::string_view, 12> kClassNames = {
    "ball",      "cylinder",      "nut",        "bolt", "spanner", "brick 1x2",
    "brick 2x3", "USB mini plug", "USB-C plug", "key",  "hex key", "mesh pen holder"};
inline constexpr std::size_t kClasses = kClassNames.size();
/// Probabilities of the classes and, last, of every other shape.
using Probabilities = std::array<double, kClasses + 1>;

/// The network that tests/recognition/train.py made. Its weights are part of the program.
class Network {
 public:
  Network();

  struct Output {
    Probabilities probabilities{};
    std::vector<float> features;  ///< Of length 1.
  };
  [[nodiscard]] Output run(const TouchMap& map);

  /// SHA-256 of the weights, hexadecimal.
  [[nodiscard]] static std::string_view hash();

 private:
  cv::dnn::Net net_;
};

enum class Verdict : std::uint8_t { known, unknown, unsure, too_shallow, cut_off };

/// An object that a user has taught: taught_objects.hpp.
struct TaughtObject;

/// What is in contact, as far as the presses show.
struct Recognised {
  Verdict verdict = Verdict::unsure;
  Probabilities probabilities{};  ///< Of the classes; they leave out taught objects.
  struct Candidate {
    std::string name;
    double probability = 0;
    bool taught = false;
  };
  std::vector<Candidate> candidates;  ///< Most probable first.
  double score = 0;                   ///< Probability that it is a known object at all.
  int presses = 0;                    ///< Joined in it.
};

/// Joins the network's outputs over a contact, and over several.
class Evidence {
 public:
  void set_taught(std::shared_ptr<const std::vector<TaughtObject>> taught) {
    taught_ = std::move(taught);
  }
  /// One more frame of the contact.
  void add(const TouchMap& map, const Network::Output& output);
  /// The contact has ended.
  void release();
  /// Another sensor or calibration: earlier contacts no longer count.
  void forget();
  /// Of the last `presses` contacts, the present one included. A contact too shallow to tell
  /// anything does not count.
  [[nodiscard]] Recognised result(int presses) const;

  static constexpr int kMaxPresses = 10;

 private:
  struct Press {
    Probabilities log_sum{};
    std::vector<float> features;  ///< Their sum.
    int frames = 0;
    double deepest_mm = 0;
    double cut = 0;
  };
  /// Probability of each taught object, by its distance from the presses: 0 outside its radius.
  [[nodiscard]] std::vector<double> taught_probabilities(
      const std::vector<const Press*>& presses) const;

  std::shared_ptr<const std::vector<TaughtObject>> taught_;
  Press now_;
  std::deque<Press> before_;  ///< Newest last.
};

}  // namespace dtact::perceive
