#include <string>

#include "viewer/panels/panels.h"

namespace tessera::viewer {

void DrawMessagesPanel(const Rectangle& place, ViewerState& state) {
  if (state.messages().empty()) {
    return;
  }
  ImGui::SetNextWindowPos(place.corner);
  ImGui::SetNextWindowSize(ImVec2(place.size.x, 0.0F));
  ImGui::Begin("Messages", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoFocusOnAppearing);
  std::string dismissed;
  for (const Notice& message : state.messages()) {
    ImGui::PushID(message.subject.c_str());
    if (ImGui::SmallButton("x")) {
      dismissed = message.subject;
    }
    ImGui::SameLine();
    ImGui::PushStyleColor(ImGuiCol_Text, message.is_error ? ImVec4(1.0F, 0.55F, 0.45F, 1.0F)
                                                          : ImVec4(0.95F, 0.85F, 0.55F, 1.0F));
    ImGui::TextWrapped("%s", message.text.c_str());
    ImGui::PopStyleColor();
    ImGui::PopID();
  }
  ImGui::End();
  if (!dismissed.empty()) {
    state.DismissMessage(dismissed);
  }
}

}  // namespace tessera::viewer
