/* SPDX-License-Identifier: Apache-2.0 */
/* web-export: writes docs/web-keys.csv, every key that a configuration of drivebridge-webd may have. */
#include "web/config.h"

int main(void)
{
	return db_settings_write_csv(db_web_keys, stdout) == 0 ? 0 : 1;
}
