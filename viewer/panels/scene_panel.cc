#include <algorithm>

#include "viewer/panels/panels.h"

namespace tessera::viewer {
namespace {

void MoveByMouse(ViewerState& state, int height) {
  const ImGuiIO& io = ImGui::GetIO();
  const double right = io.MouseDelta.x;
  const double down = io.MouseDelta.y;
  if (ImGui::IsItemActive() && (right != 0.0 || down != 0.0)) {
    if (ImGui::IsMouseDown(ImGuiMouseButton_Right)) {
      state.light.Drag(right, down, height);
    } else if (ImGui::IsMouseDown(ImGuiMouseButton_Middle) || io.KeyShift) {
      state.camera.Pan(right, down, height);
    } else {
      state.camera.Orbit(right, down, height);
    }
  }
  if (ImGui::IsItemHovered() && io.MouseWheel != 0.0F) {
    state.camera.Zoom(io.MouseWheel);
  }
}

}  // namespace

ImVec2 DrawScenePanel(const Rectangle& place, ViewerState& state, const GuiTexture* picture) {
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(0.0F, 0.0F));
  ImGui::SetNextWindowPos(place.corner);
  ImGui::SetNextWindowSize(place.size);
  ImGui::Begin("Scene", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoBringToFrontOnFocus);
  const ImVec2 size(std::max(ImGui::GetContentRegionAvail().x, 16.0F),
                    std::max(ImGui::GetContentRegionAvail().y, 16.0F));
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::InvisibleButton("scene", size,
                         ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                             ImGuiButtonFlags_MouseButtonMiddle);
  MoveByMouse(state, static_cast<int>(size.y));
  if (picture != nullptr) {
    ImGui::GetWindowDrawList()->AddImage(picture->id(), corner, ImVec2(corner.x + size.x, corner.y + size.y));
  }
  ImGui::End();
  ImGui::PopStyleVar();
  const ImVec2 scale = ImGui::GetIO().DisplayFramebufferScale;
  return {size.x * scale.x, size.y * scale.y};
}

}  // namespace tessera::viewer
