#include "tests/accuracy/study/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace dtact::study {
namespace {

std::string text(Value value, int digits) {
  return value ? fmt::format("{:.{}f}", *value, digits) : "–";
}

}  // namespace

bool within(Value value, const figures::Range& range) {
  return value && *value >= range.least && *value <= range.greatest;
}

bool within(Value value, const figures::Spread& spread) {
  return value && std::abs(*value - spread.median) <= 2 * spread.sd;
}

Comparison::Comparison(const std::vector<Result>& results) : results_(results) {
  for (const Result& r : results) {
    if (std::ranges::find(laws_, r.law) == laws_.end()) laws_.push_back(r.law);
  }
}

const Result* Comparison::find(const std::string& law, double thickness_mm) const {
  const auto found = std::ranges::find_if(
      results_, [&](const Result& r) { return r.law == law && r.thickness_mm == thickness_mm; });
  return found == results_.end() ? nullptr : &*found;
}

void Comparison::add(const std::string& what, const std::string& study, int digits,
                     const std::function<Value(const std::string&)>& value,
                     const std::function<bool(Value)>& agrees, const std::string& remark) {
  Row row{what, study, {}, agrees(value(laws_.front())), remark};
  for (const std::string& law : laws_) row.simulated.push_back(text(value(law), digits));
  rows_.push_back(std::move(row));
}

void Comparison::by_gel(const std::string& what, std::span<const figures::Range> study, int digits,
                        const std::function<Value(const Result&)>& value,
                        const std::string& remark) {
  for (std::size_t i = 0; i < study.size(); ++i) {
    const double gel = figures::kGelThicknesses_mm[i];
    add(
        fmt::format("{}, gel of {} mm", what, gel),
        fmt::format("{:.{}f} ({:.{}f} … {:.{}f})", study[i].median, digits, study[i].least, digits,
                    study[i].greatest, digits),
        digits,
        [&](const std::string& law) {
          const Result* const result = find(law, gel);
          return result == nullptr ? std::nullopt : value(*result);
        },
        [&](Value v) { return within(v, study[i]); }, remark);
  }
}

Value Comparison::over_gels(const std::string& law,
                            const std::function<Value(const Result&)>& value) const {
  double sum = 0;
  int count = 0;
  for (const double gel : figures::kGelThicknesses_mm) {
    const Result* const result = find(law, gel);
    const Value v = result == nullptr ? std::nullopt : value(*result);
    if (!v) continue;
    sum += *v;
    ++count;
  }
  return count > 0 ? Value(sum / count) : std::nullopt;
}

}  // namespace dtact::study
