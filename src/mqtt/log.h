/* SPDX-License-Identifier: Apache-2.0 */
/* Lines for the journal on standard error, with the level in front as sd-daemon(3) has it where the journal reads. */
#ifndef DRIVEBRIDGE_MQTT_LOG_H
#define DRIVEBRIDGE_MQTT_LOG_H

enum db_mqtt_level { DB_MQTT_ERROR = 3, DB_MQTT_WARNING = 4, DB_MQTT_NOTICE = 5, DB_MQTT_INFO = 6 };

/* A sentence without a full stop; control characters of foreign texts become question marks. */
void db_mqtt_log(enum db_mqtt_level level, const char *format, ...)
	__attribute__((format(printf, 2, 3)));

#endif
