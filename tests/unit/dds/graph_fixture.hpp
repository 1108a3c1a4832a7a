#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>

#include "clients/dds/graph.hpp"
#include "clients/dds/sensor.hpp"

namespace dtact::dds {

/// Takes up to `most` messages.
template <typename Message, typename Take>
std::size_t take(dds_entity_t reader, const dds_topic_descriptor_t& type, std::size_t most,
                 Take taken) {
  for (std::size_t count = 0; count < most; ++count) {
    Message message{};
    void* to = &message;
    dds_sample_info_t info{};
    if (dds_take(reader, &to, &info, 1, 1) <= 0) return count;
    if (info.valid_data) taken(message);
    dds_sample_free(&message, &type, DDS_FREE_CONTENTS);
  }
  return most;
}

/// A graph on a domain of this process.
class Dds : public testing::Test {
 protected:
  void SetUp() override {
    // Below 102, where the ports are not those that systems give to others.
    domain = 20 + static_cast<std::uint32_t>(::getpid()) % 80;
    try {
      graph.emplace(Graph::Config{.domain = domain, .interfaces = {}, .peers = {}});
    } catch (const std::runtime_error& e) {
      GTEST_SKIP() << e.what();
    }
  }

  /// A sensor named left.
  Sensor& add_sensor(const client::Options& options, const Settings& settings = {}) {
    return sensor.emplace(*graph, cli::NamedDaemon{"left", options}, std::nullopt, settings,
                          [this](const std::string& line) {
                            if (line.starts_with("left is there")) there = true;
                          });
  }
  [[nodiscard]] dds_entity_t subscribe(const std::string& topic) const {
    const auto found = std::ranges::find(graph->published(), topic, &Graph::Published::topic);
    return graph->subscribe(*found, graph->make_waitset());
  }

  std::uint32_t domain = 0;
  std::optional<Graph> graph;
  std::atomic<bool> there = false;
  std::optional<Sensor> sensor;
};

}  // namespace dtact::dds
