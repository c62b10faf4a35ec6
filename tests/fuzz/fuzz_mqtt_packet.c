/* SPDX-License-Identifier: Apache-2.0 */
/* Any bytes from a broker: a whole packet lies within them and is the same whatever follows it; what is wrong or not
 * whole gets no better by being cut. */
#include "mqtt/packet.h"

#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	for (int version_5 = 0; version_5 < 2; version_5++) {
		size_t length;
		size_t again;
		enum db_mqtt_verdict verdict = db_mqtt_packet_check(data, size, version_5 != 0,
		                                                    &length);

		if (verdict == DB_MQTT_PACKET_WHOLE &&
		    (length < 2 || length > size || length > DB_MQTT_PACKET_MAX ||
		     db_mqtt_packet_check(data, length, version_5 != 0, &again) !=
		             DB_MQTT_PACKET_WHOLE ||
		     again != length ||
		     db_mqtt_packet_check(data, length - 1, version_5 != 0, &again) !=
		             DB_MQTT_PACKET_PART))
			abort();
		if (verdict == DB_MQTT_PACKET_PART && size > DB_MQTT_PACKET_MAX)
			abort();
	}
	return 0;
}
