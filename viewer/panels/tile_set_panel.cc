#include <fmt/format.h>

#include "viewer/panels/panels.h"

namespace tessera::viewer {
namespace {

constexpr float kThumbnailSide = 72.0F;  // as shown
constexpr float kRowHeight = kThumbnailSide + 8.0F;
constexpr ImU32 kPlaceholder = IM_COL32(70, 70, 72, 255);
const ImVec4 kDim(0.65F, 0.66F, 0.68F, 1.0F);

// "wool" of "surface-96/wool".
std::string LastPart(const std::string& name) {
  return name.substr(name.rfind('/') + 1);
}

std::string StateOf(const ViewerState& state, const TileSetEntry& entry) {
  if (entry.name == state.selected() && state.is_loading()) {
    return "loading..";
  }
  if (entry.name == state.shown_name()) {
    return "shown";
  }
  return state.IsResident(entry) ? "ready" : "";
}

void DrawThumbnail(ImVec2 corner, const GuiTexture* thumbnail) {
  const ImVec2 end(corner.x + kThumbnailSide, corner.y + kThumbnailSide);
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  if (thumbnail != nullptr) {
    draw.AddImage(thumbnail->id(), corner, end);
  } else {
    draw.AddRectFilled(corner, end, kPlaceholder);
    draw.AddRect(corner, end, ImGui::GetColorU32(ImGuiCol_Border));
  }
}

void DrawEntry(ViewerState& state, const TileSetEntry& entry, const GuiTexture* thumbnail) {
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const ImVec2 local = ImGui::GetCursorPos();
  if (ImGui::Selectable(("##" + entry.name).c_str(), entry.name == state.selected(), 0,
                        ImVec2(0.0F, kRowHeight))) {
    state.Select(entry.name);
  }
  if (ImGui::IsItemVisible() && thumbnail == nullptr) {
    state.WantThumbnail(entry);
  }
  const ImVec2 after = ImGui::GetCursorPos();
  DrawThumbnail(ImVec2(corner.x + 4.0F, corner.y + 4.0F), thumbnail);
  const float text_x = local.x + kThumbnailSide + 14.0F;
  const auto line = [&](int number) {
    ImGui::SetCursorPos(
        ImVec2(text_x, local.y + 6.0F + static_cast<float>(number) * ImGui::GetTextLineHeightWithSpacing()));
  };
  line(0);
  ImGui::TextUnformatted(LastPart(entry.name).c_str());
  line(1);
  ImGui::TextColored(kDim, "%s, %s", entry.codec.c_str(),
                     fmt::format("{:.1f} MiB", static_cast<double>(entry.size_bytes) / (1 << 20)).c_str());
  line(2);
  ImGui::TextColored(kDim, "%u tiles of %u", entry.num_tiles, entry.tile_size);
  line(3);
  ImGui::TextColored(ImVec4(0.55F, 0.80F, 0.60F, 1.0F), "%s", StateOf(state, entry).c_str());
  ImGui::SetCursorPos(after);
}

}  // namespace

void DrawTileSetPanel(const Rectangle& place, ViewerState& state,
                      const std::map<std::string, std::unique_ptr<GuiTexture>>& thumbnails) {
  BeginPanel("Tile sets", place);
  ImGui::TextColored(kDim, "%s", state.arrangement().empty() ? "no mesh yet" : state.arrangement().c_str());
  ImGui::SameLine();
  if (ImGui::SmallButton("Refresh")) {
    state.Refresh();
  }
  ImGui::Separator();
  ImGui::BeginChild("entries");
  for (const TileSetEntry& entry : state.entries()) {
    const auto thumbnail = thumbnails.find(entry.thumbnail_sha256);
    DrawEntry(state, entry, thumbnail == thumbnails.end() ? nullptr : thumbnail->second.get());
  }
  ImGui::EndChild();
  ImGui::End();
}

}  // namespace tessera::viewer
