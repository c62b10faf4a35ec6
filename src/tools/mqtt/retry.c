/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/retry.h"

void db_mqtt_retry_fail(struct db_mqtt_retry *retry, db_time now, unsigned chance)
{
	retry->wait = retry->wait == 0 ? DB_MQTT_RETRY_FIRST : 2 * retry->wait;
	if (retry->wait > DB_MQTT_RETRY_LONGEST)
		retry->wait = DB_MQTT_RETRY_LONGEST;
	retry->due = now + retry->wait + retry->wait / 2 * (chance % 1000) / 1000;
}

void db_mqtt_retry_lose(struct db_mqtt_retry *retry, db_time now, db_time spread, bool others,
                        unsigned chance)
{
	if (others)
		*retry = (struct db_mqtt_retry){ .due = now };
	else
		db_mqtt_retry_fail(retry, now, chance);
	retry->due += spread / 1000 * (chance / 1000 % 1000);
}
