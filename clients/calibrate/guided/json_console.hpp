#pragma once

#include <functional>
#include <iosfwd>

#include "clients/calibrate/guided/console.hpp"

namespace dtact::ctl::guided {

/// Speaks with a program that shows the session to a person, in lines of JSON
/// (clients/common/guided.proto).
class JsonConsole : public Console {
 public:
  /// `in`: a descriptor, not owned.
  JsonConsole(int in, std::ostream& out, std::function<bool()> interrupted);

  [[nodiscard]] bool interactive() const override { return true; }
  [[nodiscard]] Typed typed() override;
  [[nodiscard]] bool interrupted() const override { return interrupted_(); }
  void say(const std::string& text) override;
  void keep(const image::Grey8&) override {}
  void live(const Scene& scene) override;

 private:
  LineInput in_;
  std::ostream& out_;
  std::function<bool()> interrupted_;
};

}  // namespace dtact::ctl::guided
