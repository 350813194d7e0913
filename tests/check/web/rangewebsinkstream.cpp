int main () {}
