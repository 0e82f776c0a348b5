#include "viewer/panels/panels.h"

namespace tessera::viewer {

void BeginPanel(const char* title, const Rectangle& place) {
  ImGui::SetNextWindowPos(place.corner);
  ImGui::SetNextWindowSize(place.size);
  ImGui::Begin(title, nullptr,
               ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoCollapse |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoBringToFrontOnFocus);
}

}  // namespace tessera::viewer
