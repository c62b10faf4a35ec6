/* SPDX-License-Identifier: Apache-2.0 */
#include "web/roles.h"

const char *db_web_role_name(enum db_web_role role)
{
	static const char *const names[] = { "none", "reader", "operator" };

	return names[role];
}
