#include "clients/common/printable.hpp"

#include <google/protobuf/descriptor.h>

#include <vector>

#include "hal/base/utf8.hpp"

namespace dtact::cli {

using google::protobuf::FieldDescriptor;

void make_printable(google::protobuf::Message& message) {
  const google::protobuf::Reflection& all = *message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  all.ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    const int count = field->is_repeated() ? all.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
        make_printable(field->is_repeated() ? *all.MutableRepeatedMessage(&message, field, i)
                                            : *all.MutableMessage(&message, field));
      } else if (field->type() != FieldDescriptor::TYPE_STRING) {
        break;
      } else if (field->is_repeated()) {
        all.SetRepeatedString(&message, field, i,
                              base::printable(all.GetRepeatedString(message, field, i)));
      } else {
        all.SetString(&message, field, base::printable(all.GetString(message, field)));
      }
    }
  }
}

}  // namespace dtact::cli
