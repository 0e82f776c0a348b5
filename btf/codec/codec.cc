#include "btf/codec/codec.h"

#include <array>
#include <span>

#include "btf/codec/dfmf/dfmf_codec.h"
#include "btf/codec/dsh/dsh_codec.h"
#include "btf/codec/dsh/dsh_encoder.h"
#include "btf/codec/view_pca/view_pca_codec.h"

namespace tessera {
namespace {

std::span<const Codec* const> Codecs() {
  static const DshCodec dsh_cls("dsh-cls", &EncodeDshCls);
  static const DshCodec dsh("dsh", &EncodeDsh);
  static const DshCodec dsh_ls("dsh-ls", &EncodeDshLs);
  static const DfmfCodec dfmf;
  static const ViewPcaCodec view_pca;
  static const std::array codecs = {
      static_cast<const Codec*>(&dsh_cls),  static_cast<const Codec*>(&dsh),
      static_cast<const Codec*>(&dsh_ls),   static_cast<const Codec*>(&dfmf),
      static_cast<const Codec*>(&view_pca),
  };
  return codecs;
}

}  // namespace

const Codec* FindCodec(std::string_view id) {
  for (const Codec* codec : Codecs()) {
    if (codec->id() == id) {
      return codec;
    }
  }
  return nullptr;
}

std::vector<std::string_view> CodecIds() {
  std::vector<std::string_view> ids;
  for (const Codec* codec : Codecs()) {
    ids.push_back(codec->id());
  }
  return ids;
}

}  // namespace tessera
