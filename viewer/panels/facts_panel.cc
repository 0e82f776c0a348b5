#include <string>

#include <fmt/format.h>

#include "viewer/panels/panels.h"

namespace tessera::viewer {
namespace {

std::string MiB(uint64_t bytes) {
  return fmt::format("{:.2f} MiB", static_cast<double>(bytes) / (1 << 20));
}

std::string Figure(const std::optional<double>& figure) {
  return figure.has_value() ? fmt::format("{:.3f}", *figure) : "not known";
}

void Fact(const char* name, const std::string& text) {
  ImGui::TextColored(ImVec4(0.65F, 0.66F, 0.68F, 1.0F), "%s", name);
  ImGui::SameLine(110.0F);
  ImGui::PushTextWrapPos();
  ImGui::TextUnformatted(text.c_str());
  ImGui::PopTextWrapPos();
}

void DrawEntryFacts(const TileSetEntry& entry) {
  Fact("codec", entry.codec);
  Fact("container", MiB(entry.size_bytes));
  Fact("tiles", fmt::format("{} of {} x {}", entry.num_tiles, entry.tile_size, entry.tile_size));
  Fact("BTFels", fmt::format("{}", entry.num_btfels));
  Fact("seams: sides", Figure(entry.seam_ratio_borders));
  Fact("seams: inside", Figure(entry.seam_ratio_insides));
  if (entry.codec_error.has_value()) {
    Fact("codec error", fmt::format("{:.4f} RMS", *entry.codec_error));
  }
  if (!entry.origin.empty()) {
    Fact("source", entry.origin);
  }
  for (const std::string& warning : entry.warnings) {
    ImGui::PushStyleColor(ImGuiCol_Text, ImVec4(0.95F, 0.85F, 0.55F, 1.0F));
    ImGui::TextWrapped("%s", warning.c_str());
    ImGui::PopStyleColor();
  }
}

std::string MipText(const ViewFacts& facts) {
  switch (facts.mips) {
    case MipUse::kNotNeeded:
      return "not needed";
    case MipUse::kComing:
      return "being made";
    case MipUse::kDrawn:
      return "drawn";
    case MipUse::kNone:
      return "none: " + facts.why_no_mips;
  }
  return "";
}

void DrawTimes(const ViewerState& state, const ViewFacts& facts) {
  Fact("picture", fmt::format("{:.1f} ms", facts.draw_ms));
  Fact("interface", fmt::format("{:.1f} ms a frame", facts.frame_ms));
  if (facts.redress_ms > 0.0) {
    Fact("re-dressed", fmt::format("in {:.1f} ms, {}", facts.redress_ms,
                                   facts.redress_was_cached ? "resident" : "first time"));
  }
  if (facts.prepare_ms > 0.0) {
    Fact("prepared", fmt::format("in {:.1f} ms", facts.prepare_ms));
  }
  Fact("resident", fmt::format("{} sets, {}", state.num_resident(), MiB(state.resident_bytes())));
}

}  // namespace

void DrawFactsPanel(const Rectangle& place, const ViewerState& state, const ViewFacts& facts) {
  BeginPanel("Shown", place);
  if (state.shown() != nullptr) {
    ImGui::TextUnformatted(state.shown_name().c_str());
    ImGui::Separator();
    if (const TileSetEntry* const entry = state.EntryOf(state.shown_name())) {
      DrawEntryFacts(*entry);
    }
    Fact("texels/pixel", fmt::format("{:.2f}", facts.texels_per_pixel));
    Fact("mip levels", MipText(facts));
  } else {
    ImGui::TextUnformatted("nothing yet");
  }
  if (state.dressing() != nullptr) {
    Fact("mesh", fmt::format("{} quads", state.dressing()->tile.size()));
  }
  ImGui::Separator();
  DrawTimes(state, facts);
  ImGui::Separator();
  const std::string activity =
      !facts.activity.empty() ? facts.activity : std::string(facts.is_drawing ? "drawing" : "ready");
  ImGui::TextWrapped("%s", activity.c_str());
  ImGui::End();
}

}  // namespace tessera::viewer
