/* SPDX-License-Identifier: Apache-2.0 */
/* opcua-export: writes docs/opcua-keys.csv, every key that a configuration of drivebridge-opcua may have. */
#include "opcua/keys.h"

int main(void)
{
	return db_settings_write_csv(db_opcua_keys, stdout) == 0 ? 0 : 1;
}
