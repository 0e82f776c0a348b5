#include "client/cli/progress_meter.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <fmt/format.h>

namespace tessera::cli {
namespace {

constexpr auto kRedraw = std::chrono::milliseconds(100);
constexpr auto kPlainLine = std::chrono::seconds(10);
constexpr int kBarWidth = 24;
constexpr char kEraseLine[] = "\r\033[K";

double Seconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

std::string FormatRemaining(double seconds) {
  const auto whole = static_cast<int64_t>(std::ceil(std::clamp(seconds, 0.0, 359999.0)));
  if (whole >= 3600) {
    return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
  }
  return fmt::format("{}:{:02}", whole / 60, whole % 60);
}

std::string FormatAmount(double amount, std::string_view unit) {
  if (unit == "bytes") {
    constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB"};
    size_t i = 0;
    while (amount >= 1024.0 && i + 1 < std::size(kUnits)) {
      amount /= 1024.0;
      ++i;
    }
    return fmt::format("{:.{}f} {}", amount, i == 0 || amount >= 100.0 ? 0 : 1, kUnits[i]);
  }
  return fmt::format("{:.{}f} {}", amount, amount < 10.0 && amount != std::floor(amount) ? 1 : 0, unit);
}

ProgressMeter::ProgressMeter(Style style) : style_(style) {}

ProgressMeter::~ProgressMeter() {
  Finish();
}

void ProgressMeter::Report(const Progress& progress) {
  const std::lock_guard lock(mutex_);
  const auto now = Clock::now();
  if (progress.stage != stage_) {
    FinishLocked(now);
    stage_ = progress.stage;
    first_done_ = progress.done;
    stage_start_ = now;
    last_drawn_ = style_ == Style::kBar ? Clock::time_point() : now;
  }
  unit_ = progress.unit;
  done_ = progress.done;
  total_ = progress.total;
  if (now - last_drawn_ >= (style_ == Style::kBar ? kRedraw : kPlainLine)) {
    last_drawn_ = now;
    Draw(now);
  }
}

void ProgressMeter::Finish() {
  const std::lock_guard lock(mutex_);
  FinishLocked(Clock::now());
}

std::vector<StageTime> ProgressMeter::stages() const {
  const std::lock_guard lock(mutex_);
  return stages_;
}

void ProgressMeter::FinishLocked(Clock::time_point now) {
  if (stage_.empty()) {
    return;
  }
  const double seconds = Seconds(now - stage_start_);
  stages_.push_back({stage_, seconds});
  if (style_ != Style::kSilent) {
    const std::string amount = done_ == 0 ? "" : FormatAmount(static_cast<double>(done_), unit_);
    fmt::print(stderr, "{}{:<12} {:>16}  {:.2f} s\n", style_ == Style::kBar ? kEraseLine : "", stage_, amount,
               seconds);
    std::fflush(stderr);
  }
  stage_.clear();
}

void ProgressMeter::Draw(Clock::time_point now) const {
  if (style_ == Style::kBar) {
    fmt::print(stderr, "{}{}", kEraseLine, Line(now));
    std::fflush(stderr);
  } else if (style_ == Style::kLines) {
    fmt::print(stderr, "{}\n", Line(now));
    std::fflush(stderr);
  }
}

std::string ProgressMeter::Line(Clock::time_point now) const {
  const double elapsed = Seconds(now - stage_start_);
  const double rate = elapsed > 0 ? static_cast<double>(done_ - std::min(first_done_, done_)) / elapsed : 0.0;
  std::string line = fmt::format("{:<12}", stage_);
  if (total_ > 0) {
    const double share = std::min(1.0, static_cast<double>(done_) / static_cast<double>(total_));
    const auto filled = static_cast<size_t>(share * kBarWidth);
    line += fmt::format(" [{:#<{}}{:.<{}}] {:3.0f}%", "", filled, "", kBarWidth - filled, 100.0 * share);
  }
  if (done_ > 0) {
    line += unit_ == "bytes" || total_ == 0
                ? fmt::format("  {}", FormatAmount(static_cast<double>(done_), unit_))
                : fmt::format("  {}/{} {}", done_, total_, unit_);
  }
  if (rate > 0) {
    line += fmt::format("  {}/s", FormatAmount(rate, unit_));
    if (total_ > done_) {
      line += fmt::format("  {} left", FormatRemaining(static_cast<double>(total_ - done_) / rate));
    }
  }
  return line;
}

}  // namespace tessera::cli
