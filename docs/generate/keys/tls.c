/* SPDX-License-Identifier: Apache-2.0 */
/* tls-export: writes docs/tls-keys.csv, every key that a configuration of drivebridge-tls may have. */
#include "tls/config.h"

int main(void)
{
	return db_settings_write_csv(db_tls_keys, stdout) == 0 ? 0 : 1;
}
