/* SPDX-License-Identifier: Apache-2.0 */
/* mqtt-export: writes docs/mqtt-keys.csv, every key that a configuration of drivebridge-mqtt may have. */
#include "mqtt/config.h"

int main(void)
{
	return db_settings_write_csv(db_mqtt_keys, stdout) == 0 ? 0 : 1;
}
