#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tests/accuracy/study/figures.hpp"
#include "tests/accuracy/study/rows.hpp"
#include "tests/accuracy/study/study.hpp"

namespace dtact::study {

/// Nothing where a law was not measured.
using Value = std::optional<double>;

[[nodiscard]] bool within(Value value, const figures::Range& range);
/// Within two standard deviations of the units.
[[nodiscard]] bool within(Value value, const figures::Spread& spread);

/// Rows as the parts of the study add them; each part knows which results belong to which law and
/// gel. `results` must outlive it.
class Comparison {
 public:
  explicit Comparison(const std::vector<Result>& results);

  /// Laws in the results; the first one is judged.
  [[nodiscard]] const std::vector<std::string>& laws() const noexcept { return laws_; }
  /// Null without such results.
  [[nodiscard]] const Result* find(const std::string& law, double thickness_mm) const;
  /// Mean over the gels.
  [[nodiscard]] Value over_gels(const std::string& law,
                                const std::function<Value(const Result&)>& value) const;

  void add(Row row) { rows_.push_back(std::move(row)); }
  /// A row whose figure is `value` of a law.
  void add(const std::string& what, const std::string& study, int digits,
           const std::function<Value(const std::string&)>& value,
           const std::function<bool(Value)>& agrees, const std::string& remark);
  /// One row a gel.
  void by_gel(const std::string& what, std::span<const figures::Range> study, int digits,
              const std::function<Value(const Result&)>& value, const std::string& remark);

  [[nodiscard]] std::vector<Row> take() { return std::move(rows_); }

 private:
  const std::vector<Result>& results_;
  std::vector<std::string> laws_;
  std::vector<Row> rows_;
};

/// Two pillars: dips between them, how many spacings are resolved, how they lean.
void add_pillars(Comparison& comparison);

}  // namespace dtact::study
