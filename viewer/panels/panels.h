// The parts of the window. Each draws itself into its rectangle, reads what it shows and changes the state by
// what is clicked; none waits for anything.
#pragma once

#include <map>
#include <memory>
#include <string>

#include <imgui.h>

#include "viewer/gui_renderer.h"
#include "viewer/scene_view.h"
#include "viewer/viewer_state.h"

namespace tessera::viewer {

struct Rectangle {
  ImVec2 corner;  // top left
  ImVec2 size;
};

// What was measured of pictures and frames.
struct ViewFacts {
  double frame_ms = 0.0;          // of the interface, on the mean over the last ones
  double draw_ms = 0.0;           // of the last picture
  double prepare_ms = 0.0;        // of the last tile set that was not resident
  double texels_per_pixel = 0.0;  // along a pixel's side
  MipUse mips = MipUse::kNotNeeded;
  std::string why_no_mips;
  double redress_ms = 0.0;  // from the last click to the picture; 0 before the first
  bool redress_was_cached = false;
  std::string activity;  // what the loader does; empty when nothing
  bool is_drawing = false;
};

// A column of tile sets: picture, name, codec and size. A click shows one. `thumbnails` by their digest; grey
// where there is none.
void DrawTileSetPanel(const Rectangle& place, ViewerState& state,
                      const std::map<std::string, std::unique_ptr<GuiTexture>>& thumbnails);
// The picture; dragging it orbits (left), pans (middle, or shift and left) and moves the light (right), the
// wheel zooms. Returns the size in pixels that the next picture should have.
ImVec2 DrawScenePanel(const Rectangle& place, ViewerState& state, const GuiTexture* picture);
// What is shown: codec, bytes, certificate, times.
void DrawFactsPanel(const Rectangle& place, const ViewerState& state, const ViewFacts& facts);
// Light by angles, exposure and tone curve, camera.
void DrawLightPanel(const Rectangle& place, ViewerState& state);
// Errors and notes, over the picture; nothing when there are none.
void DrawMessagesPanel(const Rectangle& place, ViewerState& state);

// Opens a panel that neither moves nor changes its size; ImGui::End() closes it.
void BeginPanel(const char* title, const Rectangle& place);

}  // namespace tessera::viewer
