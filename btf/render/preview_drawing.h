// The draws of one picture.
#pragma once

#include <span>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/image/image.h"
#include "btf/render/preview_resources.h"

namespace tessera {

// Each light is drawn on its own and added up in a float buffer, so that their number is bounded by time
// alone; light from all around comes after them. With shadows, lights go in batches, as many as have their
// maps at once. The context must be current.
class PreviewDrawing {
 public:
  PreviewDrawing(GlPreview::Resources& resources, const PreviewScene& scene)
      : resources_(resources),
        gl_(resources.gl),
        scene_(scene),
        view_(MakeViewFrame(scene.camera, resources.triangles)) {}

  // As GlPreview::Render, of a scene that CheckScene likes.
  [[nodiscard]] absl::StatusOr<Image> Draw(const RunContext& context);

 private:
  // Rows [first, first + rows) of the picture, whose samples are held at once.
  struct Band {
    int first = 0;
    int rows = 0;
  };

  absl::Status PreparePrograms();
  absl::Status PrepareTargets(int band_rows);
  void DrawSamples(const Band& band);
  // The next lights to draw from `first` on: all, or those whose maps it draws.
  std::span<const Light> NextBatch(size_t first);
  absl::Status ShadeBand(const Band& band, const RunContext& context);
  // What every pass of `program` has in common; the number of texture units in use.
  int BeginPass(GLuint program, bool is_first, int first_row, int num_rows);
  // `light` is the number of one in lights_, of the batch at hand.
  void Shade(size_t light, int first_row, int num_rows);
  void ShadeAllAround(int first_row, int num_rows);
  void SetLight(size_t light);
  void SetMips(GLuint program);
  void SetShadows(const LightMaps& maps, int unit);

  GlPreview::Resources& resources_;
  const GladGLContext& gl_;
  const PreviewScene& scene_;
  const ViewFrame view_;
  std::vector<Light> lights_;
  size_t batch_begin_ = 0;
  std::vector<LightMaps> maps_;  // of the lights from batch_begin_ on
  GLuint empty_program_ = 0;
  GLuint surface_program_ = 0;
  GLuint shade_program_ = 0;
  GLuint harmonics_program_ = 0;
  GLuint shadow_program_ = 0;
};

}  // namespace tessera
