// Through a real socket.
#include <span>

#include <gtest/gtest.h>

#include "btf/image/image_io.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dressing.h"
#include "btf/wang/tile_set.h"
#include "proto/wire/convert.h"
#include "server/jobs/thumbnail_job.h"
#include "tests/server/support/server_fixture.h"

namespace tessera {
namespace {

TEST_F(ServerTest, ArrangementsAreTheBuiltInOnes) {
  const auto list = Stubs::Call(&v1::Arrangements::Stub::ListArrangements, *stubs_->arrangements,
                                v1::ListArrangementsRequest());
  ASSERT_TRUE(list.ok());
  ASSERT_EQ(list->arrangements_size(), static_cast<int>(BuiltinArrangements().size()));
  for (const auto& message : list->arrangements()) {
    EXPECT_TRUE(ArrangementFromMessage(message).ok());
  }
  v1::GetArrangementRequest request;
  request.set_name("arrangements/surface-96");
  EXPECT_EQ(
      Stubs::Call(&v1::Arrangements::Stub::GetArrangement, *stubs_->arrangements, request)->tile_codes_size(),
      96);
  request.set_name("arrangements/surface-97");
  EXPECT_EQ(
      ReasonOf(Stubs::Call(&v1::Arrangements::Stub::GetArrangement, *stubs_->arrangements, request).status()),
      "NOT_FOUND");
}

TEST_F(ServerTest, MeshesAreDressedAndKept) {
  v1::DressMeshRequest request;
  request.set_arrangement("arrangements/surface-96");
  request.set_builtin("torus");
  request.set_seed(5);
  const auto dress = [&] {
    return Stubs::Call(&v1::Dressings::Stub::DressMesh, *stubs_->dressings, request);
  };
  const auto torus = dress();
  ASSERT_TRUE(torus.ok()) << torus.status();
  EXPECT_EQ(torus->num_breaks(), 0u);
  const auto bytes = stubs_->Download(torus->dressing().sha256());
  const auto dressing = ParseDressing(std::as_bytes(std::span(*bytes)));
  ASSERT_TRUE(dressing.ok()) << dressing.status();
  EXPECT_EQ(dressing->mesh.quads.size(), torus->num_quads());
  EXPECT_EQ(dress()->dressing().sha256(), torus->dressing().sha256());

  request.set_mesh_sha256(stubs_->Upload("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"));
  EXPECT_TRUE(dress().ok()) << dress().status();
  request.set_mesh_sha256(stubs_->Upload("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"));
  EXPECT_TRUE(dress().ok()) << dress().status();
  request.set_mesh_sha256(stubs_->Upload("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"));
  EXPECT_EQ(ReasonOf(dress().status()), "FORMAT_INVALID");
  request.set_builtin("teapot");
  EXPECT_EQ(ReasonOf(dress().status()), "NOT_FOUND");
  request.clear_mesh();
  EXPECT_EQ(SubjectOf(dress().status()), "mesh");
}

// Every texel of every tile shows the one BTFel of the tiny material.
TileSet TinyTileSet(const char* arrangement_id = "surface-96") {
  const Material material = TinyMaterial();
  const Arrangement* arrangement = *FindArrangement(arrangement_id);
  TileSet tile_set;
  tile_set.arrangement_id = arrangement->id;
  tile_set.arrangement_sha256 = arrangement->sha256;
  tile_set.tile_size = 16;
  tile_set.strip_height = 8;
  tile_set.tile_codes = arrangement->codes;
  tile_set.tile_index.assign(arrangement->codes.size() * 16 * 16, 0);
  tile_set.btfels = material.btfels;
  tile_set.btfels.codes.resize(3);
  return tile_set;
}

class OneBlob final : public BlobReader {
 public:
  explicit OneBlob(std::string bytes) : bytes_(std::move(bytes)) {}
  absl::StatusOr<std::string> ReadAll(std::string_view /*sha256*/, uint64_t /*limit*/) const override {
    return bytes_;
  }
  absl::Status CopyTo(std::string_view /*sha256*/, const std::filesystem::path& /*file*/) const override {
    return absl::UnimplementedError("nothing is copied");
  }

 private:
  const std::string bytes_;
};

TEST_F(ServerTest, AThumbnailIsDrawnOfEachNewTileSet) {
  v1::CreateTileSetRequest create;
  create.set_name("arrangements/surface-96/tileSets/tiny");
  create.set_blob_sha256(stubs_->Upload(*SerializeTileSet(TinyTileSet())));
  const auto put = [&] {
    return Stubs::Call(&v1::TileSets::Stub::CreateTileSet, *stubs_->tile_sets, create);
  };
  ASSERT_TRUE(put().ok());
  const auto jobs = Stubs::Call(&v1::Jobs::Stub::ListJobs, *stubs_->jobs, v1::ListJobsRequest());
  ASSERT_EQ(jobs->jobs_size(), 1);
  EXPECT_EQ(jobs->jobs(0).kind(), "thumbnail");
  EXPECT_EQ(jobs->jobs(0).result_name(), create.name() + "/thumbnail");
  const auto ended = stubs_->Wait(jobs->jobs(0).name());
  EXPECT_EQ(ended->state(), v1::Job::SUCCEEDED) << ended->error().message();
  const auto thumbnail = [&] {
    v1::GetTileSetRequest get;
    get.set_name(create.name());
    return Stubs::Call(&v1::TileSets::Stub::GetTileSet, *stubs_->tile_sets, get)->thumbnail();
  };
  const auto png = stubs_->Download(thumbnail().sha256());
  ASSERT_TRUE(png.ok()) << png.status();
  EXPECT_EQ(png->size(), thumbnail().size_bytes());
  const auto picture = DecodeImage(std::as_bytes(std::span(*png)), "thumbnail.png", std::nullopt);
  ASSERT_TRUE(picture.ok()) << picture.status();
  EXPECT_EQ(picture->width, 128);
  EXPECT_EQ(picture->height, 128);
  EXPECT_EQ(picture->channels, 3);
  // One BTFel, seen from about its normal all over: no texel is far from the middle one, and none is black.
  const float middle = picture->pixels[3 * (64 * 128 + 64)];
  EXPECT_GT(middle, 0.0F);
  for (const size_t pixel : {size_t{0}, size_t{127}, size_t{127 * 128}, size_t{128 * 128 - 1}}) {
    EXPECT_NEAR(picture->pixels[3 * pixel], middle, 0.5F * middle) << pixel;
  }
  // Drawn again, the same bytes.
  const OneBlob reader(*SerializeTileSet(TinyTileSet()));
  JobContext context;
  context.blobs = &reader;
  const auto again = RunThumbnailJob({"", {create.blob_sha256()}}, context);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->blob, *png);
}

// The red of the thumbnail of tiles whose columns alternate between two BTFels, eight to a pixel.
absl::StatusOr<std::vector<float>> RedOfColumns(uint32_t even, uint32_t odd) {
  constexpr int kSide = 512;
  TileSet tile_set = TinyTileSet("plane-16");
  tile_set.tile_size = kSide;
  tile_set.btfels.step = {0.05F, 0.05F, 0.05F};
  tile_set.btfels.codes.assign(6, 0);
  tile_set.btfels.codes[0] = 10;  // of the first BTFel's luminance
  tile_set.btfels.codes[3] = 2;
  tile_set.tile_index.resize(tile_set.tile_codes.size() * kSide * kSide);
  for (size_t texel = 0; texel < tile_set.tile_index.size(); ++texel) {
    tile_set.tile_index[texel] = PackTexel(texel % 2 == 0 ? even : odd, 0);
  }
  TESSERA_ASSIGN_OR_RETURN(std::string bytes, SerializeTileSet(tile_set));
  const OneBlob reader(std::move(bytes));
  JobContext context;
  context.blobs = &reader;
  TESSERA_ASSIGN_OR_RETURN(const JobOutput output, RunThumbnailJob({"", {"blob"}}, context));
  TESSERA_ASSIGN_OR_RETURN(const Image picture,
                           DecodeImage(std::as_bytes(std::span(output.blob)), "thumbnail.png", std::nullopt));
  std::vector<float> red;
  for (size_t i = 0; i < picture.pixels.size(); i += 3) {
    red.push_back(picture.pixels[i]);
  }
  return red;
}

TEST(Thumbnail, ShowsTheMeanOfTexelsThatShareAPixel) {
  const auto bright = RedOfColumns(0, 0);
  const auto dark = RedOfColumns(1, 1);
  const auto mixed = RedOfColumns(0, 1);
  ASSERT_TRUE(bright.ok() && dark.ok() && mixed.ok()) << bright.status() << dark.status() << mixed.status();
  for (size_t pixel = 0; pixel < mixed->size(); ++pixel) {
    const float mean = 0.5F * ((*bright)[pixel] + (*dark)[pixel]);
    ASSERT_GT((*bright)[pixel], 3.0F * (*dark)[pixel]);
    ASSERT_LT((*bright)[pixel], 1.0F);
    EXPECT_NEAR((*mixed)[pixel], mean, 0.05F * mean) << pixel;
  }
}

TEST_F(ServerTest, PicturesAreDrawn) {
  const auto bytes = SerializeTileSet(TinyTileSet());
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  v1::CreateTileSetRequest create;
  create.set_blob_sha256(stubs_->Upload(*bytes));
  create.set_name("arrangements/plane-16/tileSets/tiny");
  const auto create_tile_set = [&] {
    return Stubs::Call(&v1::TileSets::Stub::CreateTileSet, *stubs_->tile_sets, create);
  };
  EXPECT_EQ(ReasonOf(create_tile_set().status()), "ARRANGEMENT_MISMATCH");
  create.set_name("arrangements/surface-96/tileSets/tiny");
  const auto created = create_tile_set();
  ASSERT_TRUE(created.ok()) << created.status();
  EXPECT_EQ(created->num_tiles(), 96u);

  v1::RenderPreviewRequest request;
  request.set_tile_set(create.name());
  request.set_builtin("cube-sphere");
  request.set_width(64);
  request.set_height(48);
  const auto render = [&]() -> absl::StatusOr<std::string> {
    grpc::ClientContext context;
    auto reader = stubs_->previews->RenderPreview(&context, request);
    std::string picture;
    for (v1::RenderPreviewResponse chunk; reader->Read(&chunk);) {
      picture += chunk.data();
    }
    const grpc::Status status = reader->Finish();
    if (!status.ok()) {
      return StatusFromGrpc(status);
    }
    return picture;
  };
  const auto png = render();
  ASSERT_TRUE(png.ok()) << png.status();
  EXPECT_EQ(png->substr(1, 3), "PNG");
  EXPECT_EQ(*render(), *png);
  request.set_format(v1::RenderPreviewRequest::EXR);
  EXPECT_EQ(render()->substr(0, 4), "\x76\x2f\x31\x01");
  request.set_mips(v1::RenderPreviewRequest::ON);
  EXPECT_TRUE(render().ok()) << render().status();
  request.set_mips(static_cast<v1::RenderPreviewRequest::Mips>(7));
  EXPECT_EQ(SubjectOf(render().status()), "mips");
  request.clear_mips();

  // Settings of the picture: each changes it, and what is out of range is refused by its name.
  request.set_format(v1::RenderPreviewRequest::EXR);
  request.mutable_tone()->set_exposure_stops(1);
  EXPECT_EQ(SubjectOf(render().status()), "tone");
  request.clear_tone();
  request.set_background("ffffff");
  EXPECT_EQ(SubjectOf(render().status()), "background");
  request.set_format(v1::RenderPreviewRequest::PNG);
  EXPECT_NE(*render(), *png);
  request.set_background("white");
  EXPECT_EQ(SubjectOf(render().status()), "background");
  request.clear_background();
  request.mutable_tone()->set_exposure_stops(-1);
  EXPECT_NE(*render(), *png);
  request.mutable_tone()->set_exposure_stops(30);
  EXPECT_EQ(SubjectOf(render().status()), "tone");
  request.clear_tone();
  request.set_shadow_map_size(256);
  EXPECT_EQ(SubjectOf(render().status()), "shadow_map_size");
  request.set_shadows(true);
  EXPECT_TRUE(render().ok()) << render().status();
  request.set_shadow_map_size(4096);
  EXPECT_EQ(SubjectOf(render().status()), "shadow_map_size");
  request.clear_shadows();
  request.clear_shadow_map_size();
  request.mutable_orbit()->set_azimuth_deg(90);
  const auto aside = render();
  ASSERT_TRUE(aside.ok()) << aside.status();
  EXPECT_NE(*aside, *png);
  request.mutable_orbit()->set_turns_lights(true);
  EXPECT_NE(*render(), *aside);
  request.mutable_orbit()->set_elevation_deg(91);
  EXPECT_EQ(SubjectOf(render().status()), "orbit");
  request.mutable_orbit()->set_elevation_deg(0);
  request.mutable_camera()->set_eye_z(3);
  EXPECT_EQ(SubjectOf(render().status()), "orbit");
  request.clear_orbit();
  EXPECT_TRUE(render().ok()) << render().status();
  request.clear_camera();

  // Light from all around, as lights and in the frequency domain.
  Image sky(16, 8, 3);
  for (int i = 0; i < 16 * 8; ++i) {
    sky.pixels[3 * i + i % 3] = static_cast<float>(i % 16 + 1) / 8.0F;
  }
  request.set_builtin("torus");
  v1::EnvironmentLight& environment = *request.mutable_environment();
  environment.set_sha256(stubs_->Upload(*EncodeExr(sky)));
  const auto smooth = render();
  ASSERT_TRUE(smooth.ok()) << smooth.status();
  environment.set_order(5);
  EXPECT_EQ(*render(), *smooth);
  environment.set_rotation_deg(90);
  EXPECT_FALSE(*render() == *smooth);
  environment.clear_rotation_deg();
  environment.set_scale(0.5);
  EXPECT_FALSE(*render() == *smooth);
  environment.set_scale(-1);
  EXPECT_EQ(SubjectOf(render().status()), "environment");
  environment.clear_scale();
  request.set_shadows(true);
  EXPECT_EQ(SubjectOf(render().status()), "environment");
  environment.clear_method();
  const auto shadowed = render();
  ASSERT_TRUE(shadowed.ok()) << shadowed.status();
  environment.set_num_lights(50);
  EXPECT_EQ(*render(), *shadowed);
  request.clear_shadows();
  EXPECT_FALSE(*render() == *shadowed);
  request.set_builtin("cube-sphere");
  environment.set_num_lights(1001);
  EXPECT_EQ(SubjectOf(render().status()), "environment");
  environment.set_order(8);
  EXPECT_EQ(SubjectOf(render().status()), "environment");
  environment.clear_method();
  environment.set_sha256(stubs_->Upload("no picture"));
  EXPECT_EQ(SubjectOf(render().status()), "environment");
  environment.set_sha256(std::string(64, '0'));
  EXPECT_EQ(render().status().code(), absl::StatusCode::kNotFound);
  request.clear_environment();

  v1::DressMeshRequest dress;
  dress.set_arrangement("arrangements/plane-16");
  dress.set_builtin("plane");
  const auto plane = Stubs::Call(&v1::Dressings::Stub::DressMesh, *stubs_->dressings, dress);
  ASSERT_TRUE(plane.ok()) << plane.status();
  request.set_dressing_sha256(plane->dressing().sha256());
  EXPECT_EQ(ReasonOf(render().status()), "ARRANGEMENT_MISMATCH");
  request.set_width(5000);
  EXPECT_EQ(SubjectOf(render().status()), "width");
  request.set_width(64);
  request.set_tile_set("arrangements/surface-96/tileSets/none");
  EXPECT_EQ(ReasonOf(render().status()), "NOT_FOUND");
}

}  // namespace
}  // namespace tessera
