/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/ration.h"

#include <stdio.h>
#include <string.h>

#define SECOND DB_NS_PER_S

/* NULL: all places are taken. */
static struct db_mqtt_ration_place *find_place(struct db_mqtt_ration *ration, const char *drive,
                                               const char *sender, bool whole, db_time now)
{
	struct db_mqtt_ration_place *place = NULL;

	for (size_t i = 0; i < DB_MQTT_RATION_PLACES; i++) {
		struct db_mqtt_ration_place *one = &ration->places[i];

		/* After its second an entry is not needed any more. */
		if (one->drive[0] == '\0' || now - one->since >= SECOND)
			place = one;
		else if (one->whole == whole && strcmp(one->drive, drive) == 0 &&
		         strcmp(one->sender, sender) == 0)
			return one;
	}
	if (!place)
		return NULL;
	*place = (struct db_mqtt_ration_place){
		.whole = whole,
		.left = whole ? DB_MQTT_RATION_DRIVE : DB_MQTT_RATION_SENDER,
		.since = now,
	};
	snprintf(place->drive, sizeof(place->drive), "%s", drive);
	snprintf(place->sender, sizeof(place->sender), "%s", sender);
	return place;
}

bool db_mqtt_ration_take(struct db_mqtt_ration *ration, const char *drive, const char *sender,
                         db_time now)
{
	struct db_mqtt_ration_place *whole = find_place(ration, drive, "", true, now);
	struct db_mqtt_ration_place *own;

	/* The drive's limit is checked before the sender's: invented names take no more places than
	 * there are answers. */
	if (!whole || whole->left == 0)
		return false;
	own = find_place(ration, drive, sender, false, now);
	if (!own || own->left == 0)
		return false;
	whole->left--;
	own->left--;
	return true;
}
