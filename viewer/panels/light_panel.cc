#include "btf/math/conventions.h"
#include "viewer/panels/panels.h"

namespace tessera::viewer {
namespace {

constexpr float kMostStops = 8.0F;  // of the slider, up and down
constexpr float kMostWhite = 64.0F;

void DrawToneControls(Tone& tone) {
  float stops = static_cast<float>(tone.exposure_stops);
  if (ImGui::SliderFloat("exposure", &stops, -kMostStops, kMostStops, "%+.1f stops")) {
    tone.exposure_stops = stops;
  }
  // In the order of ToneCurve.
  int curve = static_cast<int>(tone.curve);
  if (ImGui::Combo("tone", &curve, "none\0reinhard\0filmic\0")) {
    tone.curve = static_cast<ToneCurve>(curve);
  }
  float white = static_cast<float>(tone.white);
  if (tone.curve == ToneCurve::kReinhard &&
      ImGui::SliderFloat("white", &white, 0.5F, kMostWhite, "%.1f", ImGuiSliderFlags_Logarithmic)) {
    tone.white = white;
  }
}

void DrawSkyControls(Sky& sky) {
  float azimuth_deg = static_cast<float>(DegFromRad(sky.azimuth_rad));
  if (ImGui::SliderFloat("sky turn", &azimuth_deg, 0.0F, 360.0F, "%.0f deg")) {
    sky.azimuth_rad = RadFromDeg(azimuth_deg);
  }
  float strength = static_cast<float>(sky.strength);
  if (ImGui::SliderFloat("sky", &strength, 0.0F, 8.0F, "%.2f")) {
    sky.strength = strength;
  }
}

}  // namespace

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
  if (state.sky.light != nullptr) {
    DrawSkyControls(state.sky);
  }
  DrawToneControls(state.tone);
  ImGui::PopItemWidth();
  if (ImGui::Button("Frame the mesh")) {
    state.ResetCamera();
  }
  ImGui::Separator();
  ImGui::TextWrapped("left drag: orbit\nmiddle or shift drag: pan\nwheel: zoom\nright drag: light");
  ImGui::End();
}

}  // namespace tessera::viewer
