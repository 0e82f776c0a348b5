#include "btf/math/conventions.h"
#include "viewer/panels/panels.h"

namespace tessera::viewer {

void DrawLightPanel(const Rectangle& place, ViewerState& state) {
  BeginPanel("Light and camera", place);
  ImGui::PushItemWidth(-90.0F);
  float azimuth_deg = static_cast<float>(DegFromRad(state.light.azimuth_rad));
  float elevation_deg = static_cast<float>(DegFromRad(state.light.elevation_rad));
  bool is_moved = ImGui::SliderFloat("azimuth", &azimuth_deg, 0.0F, 360.0F, "%.0f deg");
  is_moved |= ImGui::SliderFloat("elevation", &elevation_deg, -90.0F, 90.0F, "%.0f deg");
  if (is_moved) {
    state.light.Set(RadFromDeg(azimuth_deg), RadFromDeg(elevation_deg));
  }
  float strength = static_cast<float>(state.light.strength);
  if (ImGui::SliderFloat("strength", &strength, 0.0F, 8.0F, "%.2f")) {
    state.light.strength = strength;
  }
  ImGui::PopItemWidth();
  if (ImGui::Button("Frame the mesh")) {
    state.ResetCamera();
  }
  ImGui::Separator();
  ImGui::TextWrapped("left drag: orbit\nmiddle or shift drag: pan\nwheel: zoom\nright drag: light");
  ImGui::End();
}

}  // namespace tessera::viewer
