#include "btf/codec/codec.h"

#include <array>

#include "btf/codec/dsh/dsh_codec.h"

namespace tessera {
namespace {

const std::array<const Codec*, 1>& Codecs() {
  static const DshClsCodec dsh_cls;
  static const std::array<const Codec*, 1> codecs = {&dsh_cls};
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
